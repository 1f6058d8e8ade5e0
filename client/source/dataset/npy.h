// NumPy's .npy format, version 1.0: what numpy.load reads without pickle.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/strings/string_view.h>

#include "touchstone/v1/types.pb.h"

namespace touchstone::client {

// "<f4", "<f8", "|u1", "<i4", "<u8"; empty for types that are no numbers.
std::string NumpyType(v1::DataType type);

// Everything before the data: little endian, C order, the data then begins at a multiple of 64 bytes.
std::string NpyHeader(v1::DataType type, const std::vector<uint64_t>& shape);

// A whole file.
std::string NpyFile(v1::DataType type, const std::vector<uint64_t>& shape, absl::string_view data);

}  // namespace touchstone::client
