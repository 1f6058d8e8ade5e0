// What messages call one of several files.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace touchstone {

// The name of file `index` without its folders; the whole path where another of them has the same name.
std::string FileLabel(const std::vector<std::string>& paths, size_t index);

}  // namespace touchstone
