#include "client/source/dataset/npy.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

namespace touchstone::client {

std::string NumpyType(v1::DataType type) {
  switch (type) {
    case v1::DATA_TYPE_FLOAT32:
      return "<f4";
    case v1::DATA_TYPE_FLOAT64:
      return "<f8";
    case v1::DATA_TYPE_UINT8:
      return "|u1";
    case v1::DATA_TYPE_INT32:
      return "<i4";
    case v1::DATA_TYPE_UINT64:
      return "<u8";
    default:
      return "";
  }
}

std::string NpyHeader(v1::DataType type, const std::vector<uint64_t>& shape) {
  // A tuple of one has a comma in Python.
  std::string dictionary =
      absl::StrCat("{'descr': '", NumpyType(type), "', 'fortran_order': False, 'shape': (",
                   absl::StrJoin(shape, ", "), shape.size() == 1 ? ",), }" : "), }");
  constexpr size_t kPrefix = 10;  // magic, version, length
  dictionary.append(63 - (kPrefix + dictionary.size()) % 64, ' ');
  dictionary.push_back('\n');
  std::string header("\x93NUMPY\x01\x00", 8);
  header.push_back(static_cast<char>(dictionary.size() & 0xFF));
  header.push_back(static_cast<char>(dictionary.size() >> 8));
  return header + dictionary;
}

std::string NpyFile(v1::DataType type, const std::vector<uint64_t>& shape, absl::string_view data) {
  std::string file = NpyHeader(type, shape);
  file.append(data.data(), data.size());
  return file;
}

}  // namespace touchstone::client
