#include "server/service/physical_dataset.h"

#include <absl/strings/str_cat.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/service/convert.h"
#include "server/service/physical_source_service.h"
#include "server/session/command_bytes.h"

namespace touchstone {
namespace {

template <typename T>
void Append(T value, std::string* data) {
  data->append(reinterpret_cast<const char*>(&value), sizeof value);
}

void AppendVector(const Eigen::Vector3d& v, std::string* data) {
  for (int i = 0; i < 3; ++i) Append(static_cast<float>(v[i]), data);
}

}  // namespace

std::string DatasetKey(const v1::DatasetSpec& spec) {
  v1::DatasetSpec decisive;
  *decisive.mutable_objects() = spec.objects();
  *decisive.mutable_plan() = spec.plan();
  decisive.set_seed(spec.seed());
  // Maps in the order of their keys: equal specifications, equal bytes.
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    decisive.SerializeToCodedStream(&coded);
  }
  return Sha256Hex(bytes).substr(0, 16);
}

std::string CommandBytes(const CommandedTouch& touch) {
  v1::CommandedTouch command = ToProto(touch);
  command.clear_session_time_s();  // when it is made does not make it another touch
  return CommandBytes(command);
}

absl::StatusOr<PhysicalDataset> PhysicalDataset::Create(
    std::shared_ptr<const DatasetSpecification> specification, std::vector<std::string> names,
    const DatasetPart& part, std::string session, std::string key, RigDevice* source) {
  PhysicalDataset dataset;
  dataset.part_ = part;
  if (part.stop_index > specification->samples)
    return absl::OutOfRangeError(absl::StrCat("stop_index = ", part.stop_index, ": the dataset has ",
                                              specification->samples, " samples"));
  if (specification->columns.image && !source->has_camera())
    return absl::InvalidArgumentError("spec.columns has 'image': this source has no camera");
  if (dataset.part_.stop_index == 0) dataset.part_.stop_index = specification->samples;
  // A touch takes seconds: whoever waits for a batch should not wait for hours.
  if (dataset.part_.batch_size == 0) dataset.part_.batch_size = 1;
  if (dataset.part_.batch_stride == 0) dataset.part_.batch_stride = 1;
  dataset.columns_ = ColumnsOf(*specification);
  for (const auto& object : specification->objects)
    dataset.generators_.push_back(
        MakePoseGenerator(specification->plan, object->bounds(), specification->seed));
  dataset.specification_ = std::move(specification);
  dataset.names_ = std::move(names);
  dataset.session_ = std::move(session);
  dataset.key_ = std::move(key);
  dataset.source_ = source;
  dataset.next_index_ = part.start_index;
  return dataset;
}

absl::StatusOr<std::optional<DatasetBatch>> PhysicalDataset::Next(const MotionGuard& guard) {
  if (next_index_ >= part_.stop_index) return std::optional<DatasetBatch>();
  DatasetBatch batch;
  batch.start_index = next_index_;
  batch.data.resize(columns_.size());
  batch.offsets.resize(columns_.size());
  const uint64_t end = std::min<uint64_t>(next_index_ + part_.batch_size, part_.stop_index);
  for (uint64_t index = next_index_; index < end; ++index) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    TOUCHSTONE_RETURN_IF_ERROR(AppendSample(index, guard, &batch));
    ++batch.rows;
  }
  next_index_ += uint64_t{part_.batch_size} * part_.batch_stride;
  return std::optional<DatasetBatch>(std::move(batch));
}

absl::StatusOr<std::pair<TouchCommand, JournalTouch>> PhysicalDataset::MakeTouch(
    uint64_t index, const MotionGuard& guard) const {
  const size_t which = index % names_.size();
  const PoseGenerator& generator = *generators_[which];
  const uint64_t number = generator.Count() == 0 ? index : index / names_.size();
  TouchCommand order;
  order.session = session_;
  order.object = names_[which];
  order.bounds = specification_->objects[which]->bounds();
  if (specification_->plan.kind == Plan::Kind::kFaces)
    order.repeat = number / (6 * specification_->plan.faces.samples_per_face);
  for (uint32_t attempt = 0; attempt < specification_->max_draws; ++attempt) {
    order.id = absl::StrCat("dataset-", key_, "-", index, "-", attempt);
    order.touch = TouchOfPlan(specification_->plan, generator, number, attempt);
    order.bytes = CommandBytes(order.touch);
    TOUCHSTONE_ASSIGN_OR_RETURN(JournalTouch touch, source_->Touch(order, guard));
    const bool complete =
        std::none_of(touch.result.fingers.begin(), touch.result.fingers.end(),
                     [](const JournalFinger& finger) { return std::isnan(finger.contact_time_s); });
    if (complete || !generator.CanRedraw()) return std::pair(order, std::move(touch));
  }
  return absl::FailedPreconditionError(
      absl::StrCat("sample ", index, ": no touch of ", specification_->max_draws,
                   " draws had all fingers hit; raise max_draws or change the plan"));
}

absl::Status PhysicalDataset::AppendSample(uint64_t index, const MotionGuard& guard,
                                           DatasetBatch* batch) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto made, MakeTouch(index, guard));
  const auto& [order, touch] = made;
  const v1::TouchResult result = ToProto(touch, session_);
  std::optional<Image> picture;
  if (specification_->columns.image) {
    const Camera camera = CameraOfTouch(order.touch.target_m, order.touch.approach, order.touch.lateral,
                                        order.touch.standoff_m);
    const ViewCommand view{session_, order.object, order.bounds, ObjectFromCamera(camera)};
    TOUCHSTONE_ASSIGN_OR_RETURN(const Frame frame, source_->Photograph(view, guard));
    TOUCHSTONE_ASSIGN_OR_RETURN(picture,
                                PictureOf(frame, source_->IntrinsicsOf(frame), specification_->image));
  }
  const float unknown = std::numeric_limits<float>::quiet_NaN();
  for (size_t column = 0; column < columns_.size(); ++column) {
    const std::string& name = columns_[column].name;
    std::string* data = &batch->data[column];
    if (name == "index")
      Append(index, data);
    else if (name == "object")
      Append(static_cast<int32_t>(index % names_.size()), data);
    else if (name == "descriptor_s")
      for (const double s : result.descriptor_s()) Append(static_cast<float>(s), data);
    else if (name == "contact_time_s")
      for (const double s : result.contact_time_s()) Append(static_cast<float>(s), data);
    else if (name == "target_m")
      AppendVector(order.touch.target_m, data);
    else if (name == "approach")
      AppendVector(order.touch.approach, data);
    else if (name == "lateral")
      AppendVector(order.touch.lateral, data);
    else if (name == "standoff_m")
      Append(static_cast<float>(order.touch.standoff_m), data);
    else if (name == "speed_m_s")
      Append(static_cast<float>(order.touch.speed_m_s), data);
    else if (picture.has_value() && name == "image")
      TOUCHSTONE_RETURN_IF_ERROR(
          AppendPicture(*picture, specification_->image, name, data, &batch->offsets[column]));
    else
      for (size_t k = 0; k < columns_[column].BytesPerSample() / sizeof(float); ++k)
        Append(unknown, data);  // not measured
  }
  return absl::OkStatus();
}

}  // namespace touchstone
