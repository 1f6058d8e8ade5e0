// The parts of the PLY reader; for ply*.cpp only.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry::ply {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
inline constexpr int kTypeBytes[] = {1, 1, 2, 2, 4, 4, 4, 8};

inline bool IsWholeType(Type type) {
  return type < Type::kFloat;
}

struct Property {
  std::string name;
  Type type = Type::kFloat;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  uint64_t line = 0;
  std::vector<Property> properties;

  int Find(absl::string_view property) const {
    for (size_t p = 0; p < properties.size(); ++p)
      if (properties[p].name == property) return static_cast<int>(p);
    return -1;
  }
};

enum class Encoding { kText, kLittleEndian, kBigEndian };

struct Header {
  Encoding encoding = Encoding::kText;
  std::vector<Element> elements;
  uint64_t lines = 0;      // of the header
  absl::string_view rows;  // what follows it
};

absl::StatusOr<Header> ReadHeader(const MeshReading& reading);

// The rows behind the header: numbers one after another, from text or from bytes.
class Rows {
 public:
  virtual ~Rows() = default;

  // Number() gives the row's numbers in the header's order, a list's length first.
  virtual absl::Status BeginRow(const Element& element, uint64_t row) = 0;
  virtual absl::Status Number(Type type, const Property& property, double* value) = 0;
  virtual absl::Status EndRow() { return absl::OkStatus(); }

  // After the last row.
  virtual absl::Status End() = 0;
  virtual uint64_t bytes_left() const = 0;
  virtual uint64_t bytes_left_in_row() const = 0;  // at most
  virtual uint64_t MinBytes(Type type) const = 0;  // that a number takes
  virtual uint64_t line() const { return 0; }      // 0: there are no lines

  // An error about the place reached.
  virtual absl::Status Error(absl::string_view what) const = 0;
};

std::unique_ptr<Rows> MakeTextRows(const MeshReading& reading, const Header& header);
std::unique_ptr<Rows> MakeBinaryRows(const MeshReading& reading, const Header& header);

}  // namespace touchstone::geometry::ply
