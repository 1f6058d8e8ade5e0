// A rig's journal served again: it gives what was recorded, and says so where nothing was.
#pragma once

#include <map>
#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "server/session/recorded_touches.h"
#include "server/source/rig_device.h"

namespace touchstone::source {

class RecordedRig : public RigDevice {
 public:
  // All sessions of the journal; they must have the same fingers.
  static absl::StatusOr<std::unique_ptr<RecordedRig>> Open(const std::string& path);

  // By its id; else by its command, the repeats of it in the order in which they were made and round again.
  // NOT_FOUND: nothing like it was recorded.
  absl::StatusOr<session::JournalTouch> Touch(const TouchCommand& command, const MotionGuard& guard) override;
  // Of whatever session has that touch.
  absl::StatusOr<std::optional<session::JournalSeries>> Series(const std::string& session,
                                                               const std::string& id) const override;
  absl::StatusOr<source::Photograph> Photograph(const ViewCommand& command,
                                                const MotionGuard& guard) override;
  bool has_camera() const override { return !images_.empty(); }
  image::Intrinsics IntrinsicsOf(const image::Frame& frame) const override;
  int fingers() const override { return touches_->fingers(); }
  double spacing_m() const override { return touches_->spacing_m(); }
  bool moves() const override { return false; }
  SourceStatus Status() const override;
  SourceState State() const override { return SourceState::kIdle; }
  session::Journal& journal() { return *journal_; }

 private:
  std::unique_ptr<session::Journal> journal_;
  std::unique_ptr<session::RecordedTouches> touches_;
  std::map<std::string, session::JournalImage> images_;  // by id
  std::map<uint64_t, const session::JournalImage*>
      frames_;  // by the number of the frame that shows it, from 1
};

}  // namespace touchstone::source
