#include "server/source/recorded_rig.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/geometry/pose.h"
#include "server/image/encoding/encode.h"
#include "server/session/journal/command_bytes.h"

namespace touchstone::source {
namespace {

constexpr double kVerticalFovRad =
    0.7853981633974483;  // 45 deg, where a journal does not say what the lens was

}  // namespace

absl::StatusOr<std::unique_ptr<RecordedRig>> RecordedRig::Open(const std::string& path) {
  return Read(path, /*failed_too=*/false);
}

absl::StatusOr<std::unique_ptr<RecordedRig>> RecordedRig::Open(const std::string& path,
                                                               RecordedFaults faults) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<RecordedRig> rig, Read(path, /*failed_too=*/true));
  rig->faults_ = std::move(faults);
  // Without a log of what failed, the journal has the last error of each touch.
  for (const session::JournalTouch& touch : rig->touches_->touches())
    if (touch.stage == session::TouchStage::kFailed && rig->faults_[touch.id].empty())
      rig->faults_[touch.id].push_back(absl::UnknownError(touch.error));
  return rig;
}

absl::StatusOr<std::unique_ptr<RecordedRig>> RecordedRig::Read(const std::string& path, bool failed_too) {
  std::unique_ptr<RecordedRig> source(new RecordedRig);
  TOUCHSTONE_ASSIGN_OR_RETURN(source->journal_,
                              session::Journal::Open(path, session::Journal::Mode::kReadOnly));
  TOUCHSTONE_ASSIGN_OR_RETURN(source->touches_,
                              session::RecordedTouches::Read(*source->journal_, {}, failed_too));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<session::JournalSession> sessions,
                              source->journal_->Sessions());
  for (const session::JournalSession& session : sessions)
    TOUCHSTONE_RETURN_IF_ERROR(
        source->journal_->ForEachImage(session.name, [&](const session::JournalImage& image) {
          source->images_[image.id] = image;
          return true;
        }));
  for (const auto& [id, image] : source->images_) source->frames_[source->frames_.size() + 1] = &image;
  return source;
}

const session::JournalTouch* RecordedRig::FindTouch(const TouchCommand& command) const {
  const session::JournalTouch* touch = touches_->FindId(command.id);
  if (touch == nullptr || touch->object != command.object ||
      !session::SameCommand(touch->command, command.bytes))
    touch = touches_->Find(command.object, command.bytes, command.repeat);
  return touch;
}

absl::Status RecordedRig::NextFault(const std::string& id, bool stays) {
  const auto faults = faults_.find(id);
  if (faults == faults_.end() || faults->second.empty()) return absl::OkStatus();
  const std::lock_guard<std::mutex> lock(asked_mutex_);
  size_t& asked = asked_[id];
  if (asked < faults->second.size()) return faults->second[asked++];
  return stays ? faults->second.back() : absl::OkStatus();
}

absl::StatusOr<session::JournalTouch> RecordedRig::Touch(const TouchCommand& command,
                                                         const MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  const session::JournalTouch* const touch = FindTouch(command);
  // What was refused before it began stands in no journal.
  if (touch == nullptr) TOUCHSTONE_RETURN_IF_ERROR(NextFault(command.id, /*stays=*/true));
  if (touch == nullptr)
    return absl::NotFoundError(
        absl::StrCat("this is a recorded session, and no such touch of '", command.object, "' was recorded"));
  TOUCHSTONE_RETURN_IF_ERROR(NextFault(touch->id, touch->stage != session::TouchStage::kDone));
  return *touch;
}

absl::StatusOr<std::optional<session::JournalSeries>> RecordedRig::Series(const std::string&,
                                                                          const std::string& id) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<session::JournalSession> sessions, journal_->Sessions());
  for (const session::JournalSession& session : sessions) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<session::JournalTouch> touch,
                                journal_->Find(session.name, id));
    if (touch.has_value()) return journal_->Series(session.name, id);
  }
  return std::optional<session::JournalSeries>();
}

absl::StatusOr<source::Photograph> RecordedRig::Photograph(const ViewCommand& command,
                                                           const MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  const auto found = images_.find(ViewId(command));
  if (found == images_.end())
    return absl::NotFoundError(absl::StrCat("this is a recorded session, and no picture of '", command.object,
                                            "' was taken from there"));
  TOUCHSTONE_ASSIGN_OR_RETURN(image::Image image, image::DecodePng(found->second.png));
  source::Photograph photograph;
  image::Frame& frame = photograph.frame;
  frame.width = image.width, frame.height = image.height;
  frame.rgb = std::move(image.pixels);
  for (const auto& [number, shown] : frames_)
    if (shown == &found->second) frame.number = number;
  photograph.unix_s = found->second.unix_s;
  const Eigen::Isometry3d base_from_camera = geometry::PoseFromVector(found->second.base_from_camera),
                          measured = geometry::PoseFromVector(found->second.measured_base_from_camera);
  if (!measured.matrix().allFinite()) return photograph;
  const Eigen::Isometry3d off = base_from_camera.inverse() * measured;
  photograph.object_from_camera = command.object_from_camera * off;
  photograph.deviation_m = off.translation().norm();
  photograph.deviation_rad = Eigen::AngleAxisd(off.rotation()).angle();
  return photograph;
}

image::Intrinsics RecordedRig::IntrinsicsOf(const image::Frame& frame) const {
  if (const auto shown = frames_.find(frame.number); shown != frames_.end() && shown->second->view) {
    const session::JournalView& view = *shown->second->view;
    return {frame.width, frame.height, view.fx_px, view.fy_px, view.cx_px, view.cy_px, view.distortion};
  }
  return image::PinholeIntrinsics(frame.width, frame.height, kVerticalFovRad);
}

SourceStatus RecordedRig::Status() const {
  SourceStatus status;
  for (const session::JournalTouch& touch : touches_->touches())
    status.touches += touch.stage == session::TouchStage::kDone;
  status.images = images_.size();
  return status;
}

}  // namespace touchstone::source
