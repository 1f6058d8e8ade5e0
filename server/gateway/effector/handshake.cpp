// How a session with the device begins: it resumes a capture that outlived the line, or starts anew with Hello.
#include <cmath>

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/gateway/effector/serial_effector.h"

namespace touchstone::gateway::effector {
namespace {

firmware::FingerConfig ConfigOf(const EffectorFinger& finger) {
  firmware::FingerConfig config;
  config.sensor = finger.sensor;
  config.active_level = finger.active_high ? 1 : 0;
  config.debounce_us = static_cast<uint32_t>(std::lround(finger.debounce_s * kMicrosecondsPerSecond));
  config.threshold = static_cast<uint16_t>(finger.threshold);
  config.hysteresis = static_cast<uint16_t>(finger.hysteresis);
  return config;
}

}  // namespace

absl::Status SerialEffector::Handshake() {
  bool armed, known;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    known = state_.boot_id != 0;
    armed = record_.armed();
    if (known) ++state_.reconnections;
  }
  if (known && armed) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool resumed, Resume());
    if (resumed) return absl::OkStatus();
  }
  return ExchangeHello();
}

absl::StatusOr<bool> SerialEffector::Resume() {
  firmware::Status found;
  bool heard = false;
  TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::StatusRequest{}, [&](const uint8_t* payload, size_t size) {
    firmware::Status status;
    if (!firmware::Decode(payload, size, &status)) return Reply::kNo;
    // Twice the same, as anywhere that one damaged frame could decide.
    const bool twice = heard && status.boot_id == found.boot_id && status.touch == found.touch;
    found = status;
    heard = true;
    return twice ? Reply::kYes : Reply::kNo;
  }));
  if (found.boot_id != state_.boot_id || found.touch != record_.touch().touch) return false;
  handshake_done_ = true;
  return ReconcileTouch().ok();
}

absl::Status SerialEffector::ExchangeHello() {
  firmware::Hello hello;
  hello.nonce = next_nonce_++;
  firmware::HelloReply reply;
  TOUCHSTONE_RETURN_IF_ERROR(Ask(hello, [&](const uint8_t* payload, size_t size) {
    firmware::HelloReply heard;
    if (!firmware::Decode(payload, size, &heard) || heard.nonce != hello.nonce) return Reply::kNo;
    reply = heard;
    return Reply::kYes;
  }));
  if (Stopping()) return absl::OkStatus();
  reply.firmware[sizeof reply.firmware - 1] = 0;
  if (reply.version != firmware::kProtocolVersion)
    return absl::FailedPreconditionError(
        absl::StrCat("end effector at ", options_.port, " (", reply.firmware, ") speaks version ",
                     static_cast<int>(reply.version), " of the protocol, this gateway version ",
                     static_cast<int>(firmware::kProtocolVersion), "; flash the firmware of this release"));
  if (reply.max_fingers < options_.fingers.size())
    return absl::FailedPreconditionError(absl::StrCat("end effector at ", options_.port, " (", reply.firmware,
                                                      ") has at most ", static_cast<int>(reply.max_fingers),
                                                      " fingers; asked for are ", options_.fingers.size()));
  if (reply.tick_hz < 1000) return absl::UnavailableError(absl::StrCat("a clock of ", reply.tick_hz, " Hz"));

  bool same_boot, unfinished;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    same_boot = state_.boot_id == reply.boot_id;
    state_.firmware = reply.firmware;
    state_.boot_id = reply.boot_id;
    state_.tick_hz = reply.tick_hz;
    unfinished = record_.touch().touch != 0 && record_.lost().empty() && !record_.Final();
    if (!same_boot) {
      clock_ = timing::ClockEstimate();
      if (unfinished)
        record_.MarkLost(absl::StrCat("the device was reset during touch ", record_.touch().touch,
                                      "; its record is gone"));
    }
  }
  if (!same_boot) sync_.Reset();
  handshake_done_ = true;
  query_at_s_ = 0;
  unexpected_statuses_ = 0;

  if (same_boot && unfinished) {
    // Hello disarmed it, so what is not in the record by now will never be.
    const absl::Status settled = ReconcileTouch();
    if (absl::IsUnavailable(settled) || absl::IsDeadlineExceeded(settled)) return settled;
    std::lock_guard<std::mutex> lock(mutex_);
    if (!record_.Final())
      record_.MarkLost(absl::StrCat("the device was disarmed during touch ", record_.touch().touch,
                                    " while the line was lost"));
  }

  {
    // Hello disarms the device. A touch that was final already stays so, but is not captured any longer: statuses
    // of an unarmed device are what is expected from now on.
    std::lock_guard<std::mutex> lock(mutex_);
    record_.EndCapture();
  }

  firmware::Configure configure;
  configure.fingers = static_cast<uint8_t>(options_.fingers.size());
  for (size_t i = 0; i < options_.fingers.size(); ++i) configure.finger[i] = ConfigOf(options_.fingers[i]);
  return Ask(configure, [&](const uint8_t* payload, size_t size) {
    firmware::Configured configured;
    return firmware::Decode(payload, size, &configured) && configured.fingers == configure.fingers
               ? Reply::kYes
               : Reply::kNo;
  });
}

}  // namespace touchstone::gateway::effector
