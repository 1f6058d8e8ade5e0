// What a session with the device does: captures of touches, their reconciliation with the device's record.
#include <algorithm>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "server/base/status.h"
#include "server/gateway/effector/serial_effector.h"

namespace touchstone::gateway::effector {
namespace {

// What a finger needs to let go when the tool is back at the start, rig time: the switch of an emulated resistor is told
// 0.1 s late.
constexpr double kReleaseS = 0.5;
constexpr double kAskAgainS = 0.01;
// What the event of a release gets to arrive, rig time: the device sends it again every 50 ms. A finger that let go
// only after the capture had ended has none.
constexpr double kReleaseEventS = 0.2;

}  // namespace

std::string FingersText(uint32_t mask) {
  std::vector<int> fingers;
  for (int i = 0; i < firmware::kMaxFingers; ++i)
    if ((mask >> i & 1) != 0) fingers.push_back(i + 1);
  return absl::StrCat(fingers.size() == 1 ? "finger " : "fingers ", absl::StrJoin(fingers, ", "));
}

absl::Status SerialEffector::RunSession() {
  const uint8_t delimiter = 0;  // ends whatever an earlier owner of the port began
  unsent_.assign(1, delimiter);
  heard_at_s_ = timing::HostNowS();
  session_error_.clear();
  TOUCHSTONE_RETURN_IF_ERROR(Handshake());
  if (Stopping()) return absl::OkStatus();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.connected = true;
    state_.why.clear();
    first_try_over_ = true;
  }
  changed_.notify_all();
  if (changes_ != nullptr) changes_->Notify();

  while (!Stopping()) {
    std::function<absl::Status()> work;
    bool needs_reconciliation;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (work_ != nullptr && !work_done_) work = work_;
      needs_reconciliation = record_.NeedsReconciliation();
    }
    if (needs_reconciliation) {
      TOUCHSTONE_RETURN_IF_ERROR(ReconcileTouch());
    } else if (work != nullptr) {
      absl::Status status = work();
      // No answer means that the line is lost.
      if (absl::IsDeadlineExceeded(status)) status = absl::UnavailableError(status.message());
      {
        std::lock_guard<std::mutex> lock(mutex_);
        work_done_ = true;
        work_status_ = status;
      }
      changed_.notify_all();
      if (absl::IsUnavailable(status)) return status;
    } else {
      TOUCHSTONE_RETURN_IF_ERROR(Pump(timing::HostNowS() + 1, [this] {
        std::lock_guard<std::mutex> lock(mutex_);
        return record_.NeedsReconciliation() || (work_ != nullptr && !work_done_);
      }));
    }
  }
  return absl::OkStatus();
}

absl::Status SerialEffector::ReadRecord(uint32_t touch,
                                        const std::function<bool(const firmware::Recalled&)>& take) {
  // Each try sends Recall once; `take` wants two answers that agree.
  for (int i = 0; i < kTries; ++i) {
    firmware::Recalled recalled;
    TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::Recall{touch}, [&](const uint8_t* payload, size_t size) {
      return firmware::Decode(payload, size, &recalled) && recalled.touch == touch ? Reply::kYes : Reply::kNo;
    }));
    if (Stopping()) return absl::UnavailableError("the gateway ends");
    if (take(recalled)) return absl::OkStatus();
    // The clock may not be known yet, without which no time is accepted.
    if (!clock_.valid)
      TOUCHSTONE_RETURN_IF_ERROR(
          Pump(timing::HostNowS() + options_.reply_timeout_s, [this] { return clock_.valid; }));
  }
  return absl::UnavailableError(
      absl::StrCat("the device's records of touch ", touch, " contradict each other"));
}

absl::Status SerialEffector::ReconcileTouch() {
  const absl::Status status = ReadRecord(record_.touch().touch, [this](const firmware::Recalled& recalled) {
    const uint64_t max_ticks = MaxTicks();
    std::lock_guard<std::mutex> lock(mutex_);
    return record_.OnReading(recalled, max_ticks);
  });
  if (absl::IsFailedPrecondition(status)) {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.MarkLost(absl::StrCat("the device has no record of touch ", record_.touch().touch, " any more"));
  }
  if (changes_ != nullptr) changes_->Notify();
  return absl::IsFailedPrecondition(status) ? absl::OkStatus() : status;
}

absl::StatusOr<EffectorTouch> SerialEffector::RecallTouch(uint32_t touch) {
  firmware::Recalled before;
  bool has_before = false;
  EffectorTouch result;
  const absl::Status status = ReadRecord(touch, [&](const firmware::Recalled& recalled) {
    for (int i = 0; i < recalled.fingers; ++i)
      if ((recalled.contact_mask >> i & 1) != 0 && recalled.ticks[i] > MaxTicks()) return false;
    const bool agreed = has_before && Agree(before, recalled);
    before = recalled;
    has_before = true;
    if (!agreed) return false;
    result.touch = touch;
    result.boot_id = state_.boot_id;
    result.contact_ticks = ContactsOf(recalled);
    return true;
  });
  if (absl::IsFailedPrecondition(status) && refused_.reason == firmware::RefusedReason::kUnknownTouch)
    return absl::NotFoundError(absl::StrCat("end effector: the device has no record of touch ", touch));
  if (!status.ok()) return status;
  TOUCHSTONE_ASSIGN_OR_RETURN(result.pressed_mask, AwaitRelease());
  return result;
}

absl::Status SerialEffector::StartCaptureOnDevice(uint32_t touch) {
  // Times of events are checked against the device's clock, so that must be known.
  const auto clock_known = [this] { return clock_.valid; };
  TOUCHSTONE_RETURN_IF_ERROR(Pump(timing::HostNowS() + kTries * options_.reply_timeout_s, clock_known));
  if (!clock_known())
    return absl::DeadlineExceededError(
        absl::StrCat("the device at ", options_.port, " answers no query of its clock"));
  const double least = (clock_.RemoteOf(timing::HostNowS() - kClockSlackS)) * state_.tick_hz;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.Begin(touch, state_.boot_id, static_cast<int>(options_.fingers.size()));
  }
  const absl::Status status = Ask(firmware::Arm{touch}, [&](const uint8_t* payload, size_t size) {
    firmware::Armed armed;
    if (!firmware::Decode(payload, size, &armed)) return Reply::kNo;
    const uint64_t max_ticks = MaxTicks();
    std::lock_guard<std::mutex> lock(mutex_);
    return record_.OnArmed(armed, least > 0 ? static_cast<uint64_t>(least) : 0, max_ticks) ? Reply::kYes
                                                                                           : Reply::kNo;
  });
  if (status.ok()) return status;
  std::string why(status.message());
  const bool refused = absl::IsFailedPrecondition(status);
  if (refused && refused_.reason == firmware::RefusedReason::kPressed) {
    why = absl::StrCat(
        FingersText(refused_.detail), (refused_.detail & (refused_.detail - 1)) == 0 ? " is" : " are",
        " pressed before the touch begins; move the tool away, or look whether something sticks");
  }
  std::lock_guard<std::mutex> lock(mutex_);
  record_.MarkLost(absl::StrCat("touch ", touch, " was not armed: ", why));
  // A device that forgot its configuration was reset: the conversation begins anew.
  if (refused && refused_.reason == firmware::RefusedReason::kNotConfigured)
    return absl::UnavailableError("end effector: the device was reset");
  return absl::Status(status.code(), absl::StrCat("end effector: ", why));
}

absl::Status SerialEffector::EndCaptureOnDevice() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.EndCapture();
  }
  TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::Disarm{}, [](const uint8_t* payload, size_t size) {
    firmware::Disarmed disarmed;
    return firmware::Decode(payload, size, &disarmed) ? Reply::kYes : Reply::kNo;
  }));
  const bool unfinished = record_.touch().touch != 0 && record_.lost().empty() && !record_.Final();
  if (unfinished) TOUCHSTONE_RETURN_IF_ERROR(ReconcileTouch());
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint32_t pressed_mask, AwaitRelease());
  {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.SetPressed(pressed_mask);
  }
  return Pump(timing::HostNowS() + kReleaseEventS / options_.time_scale, [this] {
    std::lock_guard<std::mutex> lock(mutex_);
    return !record_.AwaitsRelease();
  });
}

absl::StatusOr<uint32_t> SerialEffector::AwaitRelease() {
  double debounce_s = 0;
  for (const EffectorFinger& finger : options_.fingers) debounce_s = std::max(debounce_s, finger.debounce_s);
  const double until_s = timing::HostNowS() + (kReleaseS + 2 * debounce_s) / options_.time_scale;
  firmware::Status status;
  do {
    TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::StatusRequest{}, [&](const uint8_t* payload, size_t size) {
      return firmware::Decode(payload, size, &status) && status.boot_id == state_.boot_id ? Reply::kYes
                                                                                          : Reply::kNo;
    }));
    if (status.pressed_mask == 0 || Stopping()) break;
    TOUCHSTONE_RETURN_IF_ERROR(Pump(timing::HostNowS() + kAskAgainS, nullptr));
  } while (timing::HostNowS() < until_s);
  return status.pressed_mask;
}

}  // namespace touchstone::gateway::effector
