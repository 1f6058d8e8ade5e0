// Batches of samples, and the one table of what their columns hold: simulated or measured, the same way.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/types/span.h>

#include "server/dataset/sampler.h"
#include "server/dataset/specification.h"

namespace touchstone::dataset {

// One batch: samples start_index .. start_index + rows - 1, or those of a list.
struct DatasetBatch {
  uint64_t start_index = 0;
  uint32_t rows = 0;
  std::vector<uint64_t>
      indices;         // one per row, if they come from a list; start_index is then the place there
  uint64_t draws = 0;  // that its samples took, those that were rejected included
  std::vector<std::string> data;               // one per column, as ColumnsOf describes them
  std::vector<std::vector<uint64_t>> offsets;  // one per column: rows + 1 entries for kBytes, else empty

  uint64_t IndexOf(uint32_t row) const { return indices.empty() ? start_index + row : indices[row]; }
};

class BatchColumns {
 public:
  // Sizes the columns of `batches`, whose start_index and rows are set (only the last may have fewer rows), and
  // fills those that the index alone decides. `columns` and `batches` must outlive this.
  BatchColumns(const std::vector<ColumnInfo>& columns, size_t objects, absl::Span<DatasetBatch> batches);

  // The accepted touches of a block, whose slots count the samples from the first batch on.
  // Their draws are added to the batches'.
  void PutTouches(const TouchSampler::Block& block) const;

  // What a picture gives to the columns of images: called sample after sample.
  absl::Status AppendPicture(image::Image picture, const DatasetImage& image, DatasetBatch* batch) const;

  // Writes numbers of one column at the row of a sample, whichever of the batches it falls into.
  class Writer {
   public:
    Writer(absl::Span<DatasetBatch> batches, size_t column, size_t bytes_per_sample);
    char* At(uint32_t slot) const {
      const uint32_t batch = shift_ >= 0 ? slot >> shift_ : slot / batch_size_;
      return begin_[batch] + (slot - batch * batch_size_) * bytes_;
    }
    template <typename T>
    void Put(uint32_t slot, size_t k, T value) const {
      std::memcpy(At(slot) + k * sizeof(T), &value, sizeof(T));
    }
    void PutVector(uint32_t slot, size_t k, const Eigen::Vector3d& v) const {
      for (int i = 0; i < 3; ++i) Put(slot, 3 * k + i, static_cast<float>(v[i]));
    }

   private:
    std::vector<char*> begin_;
    uint32_t batch_size_;
    int shift_;  // batch_size_ is 1 << shift_, or -1: a division is most of what it costs to find a row
    size_t bytes_;
  };
  // What a column takes from a block of touches.
  using PutColumn = void (*)(const Writer&, const TouchSampler::Block&);

 private:
  const std::vector<ColumnInfo>& columns_;
  const absl::Span<DatasetBatch> batches_;
  std::vector<std::pair<Writer, PutColumn>> puts_;
};

// The picture of a renderer or camera as it was asked for, normalised where `image` says so: the same for every source.
absl::StatusOr<image::Image> AsAsked(image::Image picture, const DatasetImage& image);

// Appends what such a picture gives for one column ("image", "depth_m" or "mask"; any other gets nothing): raw
// values, or an encoded file and the offset of its end, the first one after a 0.
absl::Status AppendPicture(const image::Image& picture, const DatasetImage& image, const std::string& column,
                           std::string* data, std::vector<uint64_t>* offsets);

}  // namespace touchstone::dataset
