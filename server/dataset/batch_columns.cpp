#include "server/dataset/batch_columns.h"

#include <cmath>
#include <cstring>

#include "server/base/status.h"
#include "server/image/encoding/encode.h"
#include "server/image/normalize/normalize.h"
#include "server/touch/batch_row.h"

namespace touchstone::dataset {
namespace {

using Writer = BatchColumns::Writer;

// Calls put(touch, slot) for every accepted touch.
template <typename Put>
void ForAccepted(const TouchSampler::Block& block, Put put) {
  for (int touch = 0; touch < block.batch.size(); ++touch)
    if (block.accepted[touch]) put(touch, block.slots[touch]);
}

void PutDescriptor(const Writer& writer, const TouchSampler::Block& block) {
  const int size = block.batch.size(), fingers = block.batch.fingers();
  const double* const times_s = block.batch.reported_time_s.data();
  ForAccepted(block, [&](int touch, uint32_t slot) {
    char* const row = writer.At(slot);
    touch::ForDescriptor(times_s + touch, size, fingers, [row](int finger, double relative_s) {
      const float value_s = static_cast<float>(relative_s);
      std::memcpy(row + finger * sizeof(float), &value_s, sizeof(float));
    });
  });
}

void PutContactTime(const Writer& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    for (int finger = 0; finger < block.batch.fingers(); ++finger)
      writer.Put(slot, finger,
                 static_cast<float>(block.batch.reported_time_s[block.batch.At(finger, touch)]));
  });
}

template <std::vector<Eigen::Vector3d> effects::TouchBatch::*kField>
void PutFingerVectors(const Writer& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    for (int finger = 0; finger < block.batch.fingers(); ++finger)
      writer.PutVector(slot, finger, (block.batch.*kField)[block.batch.At(finger, touch)]);
  });
}

template <Eigen::Vector3d touch::TouchPose::*kField>
void PutPoseVector(const Writer& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) { writer.PutVector(slot, 0, block.Pose(touch).*kField); });
}

void PutStandoff(const Writer& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    writer.Put(slot, 0, static_cast<float>(block.Pose(touch).standoff_m));
  });
}

void PutSpeed(const Writer& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    writer.Put(slot, 0, static_cast<float>(block.batch.speed_m_s[touch]));
  });
}

void PutStdUncertainty(const Writer& writer, const TouchSampler::Block& block) {
  const int fingers = block.batch.fingers();
  ForAccepted(block, [&](int touch, uint32_t slot) {
    for (int finger = 0; finger < fingers; ++finger)
      writer.Put(slot, finger, static_cast<float>(block.uncertainty->combined_s[touch * fingers + finger]));
  });
}

void PutBeyondMeasured(const Writer& writer, const TouchSampler::Block& block) {
  const int fingers = block.batch.fingers();
  ForAccepted(block, [&](int touch, uint32_t slot) {
    for (int finger = 0; finger < fingers; ++finger)
      writer.Put(slot, finger, block.uncertainty->beyond_measured[touch * fingers + finger]);
  });
}

void PutModelValues(const Writer& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int, uint32_t slot) {
    for (size_t k = 0; k < block.model_values.size(); ++k)
      writer.Put(slot, k, static_cast<float>(block.model_values[k]));
  });
}

struct NamedPut {
  const char* name;
  BatchColumns::PutColumn put;
};
constexpr NamedPut kTouchColumns[] = {
    {"descriptor_s", PutDescriptor},
    {"contact_time_s", PutContactTime},
    {"target_m", PutPoseVector<&touch::TouchPose::target_m>},
    {"approach", PutPoseVector<&touch::TouchPose::approach>},
    {"lateral", PutPoseVector<&touch::TouchPose::lateral>},
    {"standoff_m", PutStandoff},
    {"speed_m_s", PutSpeed},
    {"contact_point_m", PutFingerVectors<&effects::TouchBatch::contact_m>},
    {"normal", PutFingerVectors<&effects::TouchBatch::normal>},
    {"std_uncertainty_s", PutStdUncertainty},
    {"beyond_measured", PutBeyondMeasured},
    {"model_values", PutModelValues},
};

}  // namespace

BatchColumns::Writer::Writer(absl::Span<DatasetBatch> batches, size_t column, size_t bytes_per_sample)
    : batch_size_(batches[0].rows),
      shift_(batch_size_ > 0 && (batch_size_ & (batch_size_ - 1)) == 0 ? __builtin_ctz(batch_size_) : -1),
      bytes_(bytes_per_sample) {
  for (DatasetBatch& batch : batches) {
    batch.data[column].resize(batch.rows * bytes_);
    begin_.push_back(batch.data[column].data());
  }
}

BatchColumns::BatchColumns(const std::vector<ColumnInfo>& columns, size_t objects,
                           absl::Span<DatasetBatch> batches)
    : columns_(columns), batches_(batches) {
  for (DatasetBatch& batch : batches) {
    batch.data.resize(columns.size());
    batch.offsets.resize(columns.size());
  }
  for (size_t column = 0; column < columns.size(); ++column) {
    const std::string& name = columns[column].name;
    const size_t bytes = columns[column].BytesPerSample();
    if (name == "index" || name == "object") {
      const Writer writer(batches, column, bytes);
      const bool is_index = name == "index";
      uint32_t slot = 0;
      for (const DatasetBatch& batch : batches)
        for (uint32_t row = 0; row < batch.rows; ++row, ++slot) {
          const uint64_t index = batch.IndexOf(row);
          if (is_index)
            writer.Put(slot, 0, index);
          else
            writer.Put(slot, 0, objects == 1 ? 0 : static_cast<int32_t>(index % objects));
        }
    } else if (name == "image" || name == "depth_m" || name == "mask") {
      for (DatasetBatch& batch : batches) batch.data[column].reserve(batch.rows * bytes);
    }
    for (const NamedPut& named : kTouchColumns)
      if (name == named.name) puts_.emplace_back(Writer(batches, column, bytes), named.put);
  }
}

void BatchColumns::PutTouches(const TouchSampler::Block& block) const {
  for (const auto& [writer, put] : puts_) put(writer, block);
  for (size_t touch = 0; touch < block.slots.size(); ++touch)
    if (block.accepted[touch]) batches_[block.slots[touch] / batches_[0].rows].draws += block.attempt + 1;
}

absl::Status BatchColumns::AppendPicture(image::Image taken, const DatasetImage& image,
                                         DatasetBatch* batch) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const image::Image picture, AsAsked(std::move(taken), image));
  for (size_t column = 0; column < columns_.size(); ++column)
    TOUCHSTONE_RETURN_IF_ERROR(touchstone::dataset::AppendPicture(
        picture, image, columns_[column].name, &batch->data[column], &batch->offsets[column]));
  return absl::OkStatus();
}

absl::StatusOr<image::Image> AsAsked(image::Image picture, const DatasetImage& image) {
  if (!image.normalize) return picture;
  TOUCHSTONE_ASSIGN_OR_RETURN(image::Image normalized, image::Normalize(picture));
  normalized.depth_m = std::move(picture.depth_m);
  return normalized;
}

absl::Status AppendPicture(const image::Image& picture, const DatasetImage& image, const std::string& column,
                           std::string* data, std::vector<uint64_t>* offsets) {
  const auto append = [data](const auto& values) {
    data->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  if (column == "depth_m") {
    append(picture.depth_m);
  } else if (column == "mask") {
    append(picture.mask);
  } else if (column == "image" && image.encoding == ImageEncoding::kRaw) {
    append(picture.pixels);
  } else if (column == "image") {
    const uint8_t* pixels = picture.pixels.data();
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::string file,
        image.encoding == ImageEncoding::kPng
            ? image::EncodePng(pixels, picture.width, picture.height, picture.channels)
            : image::EncodeJpeg(pixels, picture.width, picture.height, picture.channels, image.jpeg_quality));
    if (offsets->empty()) offsets->push_back(0);
    data->append(file);
    offsets->push_back(data->size());
  }
  return absl::OkStatus();
}

}  // namespace touchstone::dataset
