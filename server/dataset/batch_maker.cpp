#include <algorithm>
#include <cmath>
#include <cstring>

#include "server/base/status.h"
#include "server/dataset/stream.h"
#include "server/image/encode.h"

namespace touchstone {
namespace {

// Writes numbers of one column at the row of a sample, whichever batch of the run it falls into.
class ColumnWriter {
 public:
  ColumnWriter(absl::Span<DatasetBatch> batches, size_t column, uint32_t batch_size, size_t bytes_per_sample)
      : batch_size_(batch_size), bytes_(bytes_per_sample) {
    for (DatasetBatch& batch : batches) {
      batch.data[column].resize(batch.rows * bytes_);
      begin_.push_back(batch.data[column].data());
    }
  }
  char* At(uint32_t slot) const { return begin_[slot / batch_size_] + (slot % batch_size_) * bytes_; }
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
  size_t bytes_;
};

// What a column takes from a block of touches.
using PutColumn = void (*)(const ColumnWriter&, const TouchSampler::Block&);

// Calls put(touch, slot) for every accepted touch.
template <typename Put>
void ForAccepted(const TouchSampler::Block& block, Put put) {
  for (int touch = 0; touch < block.batch.size(); ++touch)
    if (block.accepted[touch]) put(touch, block.slots[touch]);
}

// Contact times relative to the first.
void PutDescriptor(const ColumnWriter& writer, const TouchSampler::Block& block) {
  const int size = block.batch.size(), fingers = block.batch.fingers();
  const double* const times_s = block.batch.reported_time_s.data();
  ForAccepted(block, [&](int touch, uint32_t slot) {
    double first_s = INFINITY;
    for (int finger = 0; finger < fingers; ++finger) {
      const double time_s = times_s[finger * size + touch];
      first_s = time_s < first_s ? time_s : first_s;
    }
    char* const row = writer.At(slot);
    for (int finger = 0; finger < fingers; ++finger) {
      const float relative_s = static_cast<float>(times_s[finger * size + touch] - first_s);
      std::memcpy(row + finger * sizeof(float), &relative_s, sizeof(float));
    }
  });
}

void PutContactTime(const ColumnWriter& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    for (int finger = 0; finger < block.batch.fingers(); ++finger)
      writer.Put(slot, finger,
                 static_cast<float>(block.batch.reported_time_s[block.batch.At(finger, touch)]));
  });
}

template <std::vector<Eigen::Vector3d> TouchBatch::*kField>
void PutFingerVectors(const ColumnWriter& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    for (int finger = 0; finger < block.batch.fingers(); ++finger)
      writer.PutVector(slot, finger, (block.batch.*kField)[block.batch.At(finger, touch)]);
  });
}

template <Eigen::Vector3d TouchPose::*kField>
void PutPoseVector(const ColumnWriter& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) { writer.PutVector(slot, 0, block.Pose(touch).*kField); });
}

void PutStandoff(const ColumnWriter& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    writer.Put(slot, 0, static_cast<float>(block.Pose(touch).standoff_m));
  });
}

void PutSpeed(const ColumnWriter& writer, const TouchSampler::Block& block) {
  ForAccepted(block, [&](int touch, uint32_t slot) {
    writer.Put(slot, 0, static_cast<float>(block.batch.speed_m_s[touch]));
  });
}

struct NamedPut {
  const char* name;
  PutColumn put;
};
constexpr NamedPut kTouchColumns[] = {
    {"descriptor_s", PutDescriptor},
    {"contact_time_s", PutContactTime},
    {"target_m", PutPoseVector<&TouchPose::target_m>},
    {"approach", PutPoseVector<&TouchPose::approach>},
    {"lateral", PutPoseVector<&TouchPose::lateral>},
    {"standoff_m", PutStandoff},
    {"speed_m_s", PutSpeed},
    {"contact_point_m", PutFingerVectors<&TouchBatch::contact_m>},
    {"normal", PutFingerVectors<&TouchBatch::normal>},
};

}  // namespace

absl::Status AppendPicture(const Image& picture, const DatasetImage& image, const std::string& column,
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
            ? EncodePng(pixels, picture.width, picture.height, picture.channels)
            : EncodeJpeg(pixels, picture.width, picture.height, picture.channels, image.jpeg_quality));
    if (offsets->empty()) offsets->push_back(0);
    data->append(file);
    offsets->push_back(data->size());
  }
  return absl::OkStatus();
}

BatchMaker::BatchMaker(std::shared_ptr<const DatasetSpecification> specification)
    : specification_(std::move(specification)),
      columns_(ColumnsOf(*specification_)),
      sampler_(*specification_) {}

absl::Status BatchMaker::Make(absl::Span<DatasetBatch> batches, const std::atomic<bool>& cancelled,
                              TouchSampler::Workspace* workspace) const {
  if (batches.empty()) return absl::OkStatus();
  const uint32_t batch_size = batches[0].rows;  // only the last may have fewer
  std::vector<uint64_t> indices;
  indices.reserve(batches.size() * batch_size);
  for (DatasetBatch& batch : batches) {
    batch.data.resize(columns_.size());
    batch.offsets.resize(columns_.size());
    for (uint32_t row = 0; row < batch.rows; ++row) indices.push_back(batch.start_index + row);
  }

  // Columns that the index alone decides, and writers for those that the simulation fills.
  const size_t objects = specification_->objects.size();
  std::vector<std::pair<ColumnWriter, PutColumn>> puts;
  for (size_t column = 0; column < columns_.size(); ++column) {
    const std::string& name = columns_[column].name;
    if (name == "index" || name == "object") {
      const ColumnWriter writer(batches, column, batch_size, columns_[column].BytesPerSample());
      const bool is_index = name == "index";
      for (size_t slot = 0; slot < indices.size(); ++slot) {
        if (is_index)
          writer.Put(slot, 0, indices[slot]);
        else
          writer.Put(slot, 0, static_cast<int32_t>(indices[slot] % objects));
      }
    }
    for (const NamedPut& named : kTouchColumns)
      if (name == named.name)
        puts.emplace_back(ColumnWriter(batches, column, batch_size, columns_[column].BytesPerSample()),
                          named.put);
  }

  std::vector<TouchPose> poses(specification_->columns.image ? indices.size() : 0);
  TOUCHSTONE_RETURN_IF_ERROR(
      sampler_.Sample(indices, cancelled, workspace, [&](const TouchSampler::Block& block) {
        for (const auto& [writer, put] : puts) put(writer, block);
        if (!poses.empty())
          for (int touch = 0; touch < block.batch.size(); ++touch)
            if (block.accepted[touch]) poses[block.slots[touch]] = block.Pose(touch);
      }));
  if (specification_->columns.image) return MakeImages(batches, poses, cancelled);
  return absl::OkStatus();
}

absl::Status BatchMaker::MakeImages(absl::Span<DatasetBatch> batches, absl::Span<const TouchPose> poses,
                                    const std::atomic<bool>& cancelled) const {
  const DatasetImage& image = specification_->image;
  size_t slot = 0;
  for (DatasetBatch& batch : batches) {
    for (size_t column = 0; column < columns_.size(); ++column)
      if (columns_[column].name == "image" || columns_[column].name == "depth_m" ||
          columns_[column].name == "mask")
        batch.data[column].reserve(batch.rows * columns_[column].BytesPerSample());
    for (uint32_t row = 0; row < batch.rows; ++row, ++slot) {
      if (cancelled.load(std::memory_order_relaxed)) return absl::CancelledError("the stream was cancelled");
      const TouchPose& pose = poses[slot];
      Camera camera = CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m);
      camera.vertical_fov_rad = image.vertical_fov_rad;
      const auto& object =
          specification_->objects[(batch.start_index + row) % specification_->objects.size()];
      TOUCHSTONE_ASSIGN_OR_RETURN(const Image picture, image.renderer->Render(object, camera, image.options));
      for (size_t column = 0; column < columns_.size(); ++column)
        TOUCHSTONE_RETURN_IF_ERROR(AppendPicture(picture, image, columns_[column].name, &batch.data[column],
                                                 &batch.offsets[column]));
    }
  }
  return absl::OkStatus();
}

}  // namespace touchstone
