// A rig's journal served again: it gives what was recorded, and says so where nothing was.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/session/recorded/recorded_touches.h"
#include "server/source/rig_device.h"

namespace touchstone::source {

// What a rig answered before a touch was done, or instead of it, in order, by the touch's id.
using RecordedFaults = std::map<std::string, std::vector<absl::Status>>;

class RecordedRig : public RigDevice {
 public:
  // All sessions of the journal; they must have the same fingers.
  static absl::StatusOr<std::unique_ptr<RecordedRig>> Open(const std::string& path);
  // The same with what failed: a touch is answered by its faults, one each time that it is asked for, and then by its
  // result; one that was never done by its last fault from then on. A journal in which nothing was done is served, too.
  static absl::StatusOr<std::unique_ptr<RecordedRig>> Open(const std::string& path, RecordedFaults faults);

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
  // Whether such a touch, done or failed, or a picture from there is in the record.
  bool Has(const TouchCommand& command) const { return FindTouch(command) != nullptr; }
  bool Has(const ViewCommand& command) const { return images_.count(ViewId(command)) > 0; }

 private:
  static absl::StatusOr<std::unique_ptr<RecordedRig>> Read(const std::string& path, bool failed_too);
  const session::JournalTouch* FindTouch(const TouchCommand& command) const;
  // The fault that is next for this id, or the last one if `stays`; OK: none is left.
  absl::Status NextFault(const std::string& id, bool stays);

  std::unique_ptr<session::Journal> journal_;
  std::unique_ptr<session::RecordedTouches> touches_;
  RecordedFaults faults_;
  std::mutex asked_mutex_;
  std::map<std::string, size_t> asked_;                  // how many faults of an id were answered
  std::map<std::string, session::JournalImage> images_;  // by id
  std::map<uint64_t, const session::JournalImage*>
      frames_;  // by the number of the frame that shows it, from 1
};

}  // namespace touchstone::source
