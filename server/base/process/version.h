// The version of the programs, as `--version`, DescribeResponse.version and dataset.json give it.
#pragma once

namespace touchstone {

// For instance "0.2.0": the version of the CMake project.
extern const char* const kVersion;

}  // namespace touchstone
