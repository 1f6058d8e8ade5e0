#include "client/source/dataset/batch.h"

#include <absl/strings/str_cat.h>

#include <cstring>

namespace touchstone::client {
namespace {

template <typename T>
double Load(const std::string& data, size_t i) {
  T value;
  std::memcpy(&value, data.data() + i * sizeof(T), sizeof(T));
  return static_cast<double>(value);
}

template <typename T>
absl::StatusOr<absl::Span<const T>> Typed(const Batch& batch, absl::string_view name, v1::DataType type) {
  const v1::Column* column = batch.Find(name);
  if (column == nullptr) {
    std::string known;
    for (const v1::Column& other : batch.message().columns())
      absl::StrAppend(&known, known.empty() ? "" : ", ", other.name());
    return absl::NotFoundError(absl::StrCat("the dataset has no column '", name, "'; it has: ", known));
  }
  if (column->type() != type)
    return absl::InvalidArgumentError(absl::StrCat(
        "column '", name, "' is ", v1::DataType_Name(column->type()), ", not ", v1::DataType_Name(type)));
  return ValuesOf<T>(*column);
}

}  // namespace

size_t BytesPerValue(v1::DataType type) {
  switch (type) {
    case v1::DATA_TYPE_FLOAT32:
    case v1::DATA_TYPE_INT32:
      return 4;
    case v1::DATA_TYPE_FLOAT64:
    case v1::DATA_TYPE_UINT64:
      return 8;
    case v1::DATA_TYPE_UINT8:
      return 1;
    default:
      return 0;
  }
}

size_t ValuesPerSample(const v1::Column& column) {
  size_t values = 1;
  for (const uint32_t side : column.shape()) values *= side;
  return values;
}

double ValueAsDouble(const v1::Column& column, size_t i) {
  switch (column.type()) {
    case v1::DATA_TYPE_FLOAT32:
      return Load<float>(column.data(), i);
    case v1::DATA_TYPE_FLOAT64:
      return Load<double>(column.data(), i);
    case v1::DATA_TYPE_UINT8:
      return Load<uint8_t>(column.data(), i);
    case v1::DATA_TYPE_INT32:
      return Load<int32_t>(column.data(), i);
    case v1::DATA_TYPE_UINT64:
      return Load<uint64_t>(column.data(), i);
    default:
      return 0;
  }
}

absl::string_view FileOf(const v1::Column& column, uint64_t row) {
  const uint64_t begin = column.offsets(static_cast<int>(row));
  const uint64_t end = column.offsets(static_cast<int>(row) + 1);
  return absl::string_view(column.data()).substr(begin, end - begin);
}

absl::Status ValidateColumn(const v1::Column& column, uint64_t rows) {
  if (column.type() == v1::DATA_TYPE_BYTES) {
    if (static_cast<uint64_t>(column.offsets_size()) != rows + 1)
      return absl::InternalError(absl::StrCat("column '", column.name(), "' has ", column.offsets_size(),
                                              " offsets for ", rows, " samples; ", rows + 1,
                                              " were expected"));
    uint64_t last = 0;
    for (const uint64_t offset : column.offsets()) {
      if (offset < last || offset > column.data().size())
        return absl::InternalError(absl::StrCat("column '", column.name(), "' has offset ", offset, " after ",
                                                last, " in ", column.data().size(), " bytes"));
      last = offset;
    }
    return absl::OkStatus();
  }
  const uint64_t expected = rows * ValuesPerSample(column) * BytesPerValue(column.type());
  if (expected == 0 && rows > 0 && BytesPerValue(column.type()) == 0)
    return absl::InternalError(absl::StrCat("column '", column.name(), "' has type ", column.type(),
                                            ", which this program does not know"));
  if (column.data().size() != expected)
    return absl::InternalError(absl::StrCat("column '", column.name(), "' has ", column.data().size(),
                                            " bytes for ", rows, " samples; ", expected, " were expected"));
  return absl::OkStatus();
}

const v1::Column* Batch::Find(absl::string_view name) const {
  for (const v1::Column& column : message_.batch().columns())
    if (column.name() == name) return &column;
  return nullptr;
}

absl::StatusOr<absl::Span<const float>> Batch::Floats(absl::string_view name) const {
  return Typed<float>(*this, name, v1::DATA_TYPE_FLOAT32);
}

absl::StatusOr<absl::Span<const double>> Batch::Doubles(absl::string_view name) const {
  return Typed<double>(*this, name, v1::DATA_TYPE_FLOAT64);
}

absl::StatusOr<absl::Span<const uint8_t>> Batch::Bytes(absl::string_view name) const {
  return Typed<uint8_t>(*this, name, v1::DATA_TYPE_UINT8);
}

}  // namespace touchstone::client
