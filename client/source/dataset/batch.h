// One batch of a dataset: columns as they came over the wire, read in place. Nothing is copied.
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <absl/types/span.h>

#include "touchstone/v1/source.pb.h"

namespace touchstone::client {

// Bytes of one value of a type; 0 for DATA_TYPE_BYTES and unknown types.
size_t BytesPerValue(v1::DataType type);

// Values of one sample of a column: the product of its shape, 1 for a scalar.
size_t ValuesPerSample(const v1::Column& column);

// The values of a numeric column as they stand in the message. T must be the column's type.
template <typename T>
absl::Span<const T> ValuesOf(const v1::Column& column) {
  return absl::Span<const T>(reinterpret_cast<const T*>(column.data().data()),
                             column.data().size() / sizeof(T));
}

// Value `i` of a numeric column as a double, whatever the column's type.
double ValueAsDouble(const v1::Column& column, size_t i);

// File `row` of a DATA_TYPE_BYTES column.
absl::string_view FileOf(const v1::Column& column, uint64_t row);

// Checks that a column holds `rows` samples: the error names it, what it holds and what it should.
absl::Status ValidateColumn(const v1::Column& column, uint64_t rows);

class Batch {
 public:
  Batch() = default;
  explicit Batch(v1::Batch batch) { *message_.mutable_batch() = std::move(batch); }

  uint64_t start_index() const { return message_.batch().start_index(); }
  uint64_t rows() const { return message_.batch().rows(); }
  const v1::Batch& message() const { return message_.batch(); }

  // The column of that name, for instance "descriptor_s"; null if the dataset has none.
  const v1::Column* Find(absl::string_view name) const;

  // The values of a column that must exist and have type T; the error says what is there instead.
  absl::StatusOr<absl::Span<const float>> Floats(absl::string_view name) const;
  absl::StatusOr<absl::Span<const double>> Doubles(absl::string_view name) const;
  absl::StatusOr<absl::Span<const uint8_t>> Bytes(absl::string_view name) const;

 private:
  friend class DatasetStream;
  // Reused from batch to batch, so that its buffers are allocated once.
  v1::StreamDatasetResponse message_;
};

}  // namespace touchstone::client
