#include "server/gateway/rig/recorded_source.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/image/encode.h"
#include "server/session/command_bytes.h"

namespace touchstone {

absl::StatusOr<std::unique_ptr<RecordedSource>> RecordedSource::Open(const std::string& path) {
  std::unique_ptr<RecordedSource> source(new RecordedSource);
  TOUCHSTONE_ASSIGN_OR_RETURN(source->journal_, Journal::Open(path, Journal::Mode::kReadOnly));
  TOUCHSTONE_ASSIGN_OR_RETURN(source->touches_, RecordedTouches::Read(*source->journal_));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<JournalSession> sessions, source->journal_->Sessions());
  for (const JournalSession& session : sessions)
    TOUCHSTONE_RETURN_IF_ERROR(source->journal_->ForEachImage(session.name, [&](const JournalImage& image) {
      source->images_[image.id] = image;
      return true;
    }));
  return source;
}

absl::StatusOr<JournalTouch> RecordedSource::Touch(const TouchOrder& order, const Permit& permit) {
  TOUCHSTONE_RETURN_IF_ERROR(permit());
  const JournalTouch* touch = touches_->FindId(order.id);
  if (touch == nullptr || touch->object != order.object || !SameCommand(touch->command, order.command))
    touch = touches_->Find(order.object, order.command, order.repeat);
  if (touch == nullptr)
    return absl::NotFoundError(
        absl::StrCat("this is a recorded session, and no such touch of '", order.object, "' was recorded"));
  return *touch;
}

absl::StatusOr<Frame> RecordedSource::Photograph(const ViewOrder& order, const Permit& permit) {
  TOUCHSTONE_RETURN_IF_ERROR(permit());
  const auto found = images_.find(ViewId(order));
  if (found == images_.end())
    return absl::NotFoundError(absl::StrCat("this is a recorded session, and no picture of '", order.object,
                                            "' was taken from there"));
  TOUCHSTONE_ASSIGN_OR_RETURN(Image image, DecodePng(found->second.png));
  Frame frame;
  frame.width = image.width, frame.height = image.height;
  frame.rgb = std::move(image.pixels);
  return frame;
}

Intrinsics RecordedSource::IntrinsicsOf(const Frame& frame) const {
  return PinholeIntrinsics(frame.width, frame.height, CameraOptions().vertical_fov_rad);
}

PhysicalFacts RecordedSource::Facts() const {
  PhysicalFacts facts;
  facts.touches = touches_->touches().size();
  facts.images = images_.size();
  return facts;
}

}  // namespace touchstone
