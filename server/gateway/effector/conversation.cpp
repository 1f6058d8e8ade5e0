// What the thread says to the device and how it takes what it hears.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "server/base/status.h"
#include "server/gateway/effector/serial_effector.h"

namespace touchstone {
namespace {

using firmware::Type;

constexpr int kTries = 8;
constexpr size_t kMaxUnsent = 4096;
constexpr double kSlackS = 1;  // of the device's clock, in host seconds

firmware::FingerConfig ConfigOf(const EffectorFinger& finger) {
  firmware::FingerConfig config;
  if (finger.sensor == "microswitch") config.sensor = firmware::Sensor::kMicroswitch;
  if (finger.sensor == "resistor") config.sensor = firmware::Sensor::kResistor;
  config.active_level = finger.active_high ? 1 : 0;
  config.debounce_us = static_cast<uint32_t>(std::lround(finger.debounce_s * 1e6));
  config.threshold = static_cast<uint16_t>(finger.threshold);
  config.hysteresis = static_cast<uint16_t>(finger.hysteresis);
  return config;
}

const char* ReasonText(firmware::RefusedReason reason) {
  switch (reason) {
    case firmware::RefusedReason::kUnknownType:
      return "it does not know the message";
    case firmware::RefusedReason::kBadLength:
      return "the message has a wrong length";
    case firmware::RefusedReason::kBadValue:
      return "a value is out of range";
    case firmware::RefusedReason::kNotConfigured:
      return "it is not configured";
    case firmware::RefusedReason::kPressed:
      return "fingers are pressed";
    case firmware::RefusedReason::kUnknownTouch:
      return "it has no record of that touch";
  }
  return "for an unknown reason";
}

}  // namespace

template <typename Message>
absl::Status SerialEffector::Send(const Message& message) {
  uint8_t payload[firmware::kMaxPayload], frame[firmware::kMaxFrame];
  const size_t size = firmware::EncodeFrame(payload, firmware::Encode(message, payload), frame);
  if (unsent_.size() > kMaxUnsent)
    return absl::UnavailableError(absl::StrCat("serial port ", options_.port, " takes no more bytes"));
  unsent_.insert(unsent_.end(), frame, frame + size);
  return Flush();
}

absl::Status SerialEffector::Flush() {
  if (unsent_.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const size_t written, port_.Write(unsent_.data(), unsent_.size()));
  unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(written));
  return absl::OkStatus();
}

// Frames of the message and of `judge` are damaged now and then: a refusal that makes no sense is a damaged
// request.
template <typename Message>
absl::Status SerialEffector::Ask(const Message& message, const Judge& judge) {
  uint8_t payload[firmware::kMaxPayload];
  firmware::Encode(message, payload);
  const uint8_t type = payload[0];
  refused_ = firmware::Refused();
  answer_ = Answer::kNo;
  judge_ = [&](const uint8_t* reply, size_t size) {
    firmware::Refused refused;
    if (!firmware::Decode(reply, size, &refused)) return judge(reply, size);
    if (refused.type != type) return Answer::kNo;
    refused_ = refused;
    const bool senseless = refused.reason == firmware::RefusedReason::kUnknownType ||
                           refused.reason == firmware::RefusedReason::kBadLength ||
                           refused.reason == firmware::RefusedReason::kBadValue;
    return senseless ? Answer::kNo : Answer::kRefused;
  };
  absl::Status status;
  for (int i = 0; i < kTries && status.ok() && answer_ == Answer::kNo && !Stopping(); ++i) {
    status = Send(message);
    if (status.ok())
      status = Pump(HostNowS() + options_.reply_timeout_s, [this] { return answer_ != Answer::kNo; });
  }
  judge_ = nullptr;
  if (!status.ok() || answer_ == Answer::kYes) return status;
  if (answer_ == Answer::kRefused || refused_.type == type)
    return absl::FailedPreconditionError(absl::StrCat("the device refuses message ", static_cast<int>(type),
                                                      ": ", ReasonText(refused_.reason)));
  return absl::DeadlineExceededError(absl::StrCat("no answer at ", options_.port, " to message ",
                                                  static_cast<int>(type), " in ", kTries, " tries of ",
                                                  options_.reply_timeout_s, " s; is this the right port?"));
}

absl::Status SerialEffector::Pump(double until_host_s, const std::function<bool()>& done) {
  for (bool first = true;; first = false) {
    if (done != nullptr && done()) return absl::OkStatus();
    if (!strange_.empty()) return absl::UnavailableError(std::exchange(strange_, ""));
    double now_s = HostNowS();
    if (!first && (now_s >= until_host_s || Stopping())) return absl::OkStatus();
    if (now_s - heard_at_s_ > options_.silence_s && greeted_)
      return absl::UnavailableError(
          absl::StrCat("nothing was heard at ", options_.port, " for ", options_.silence_s, " s"));
    if (greeted_ && now_s >= query_at_s_) QueryClock();

    double wait_s = until_host_s - now_s;
    if (greeted_) {
      wait_s = std::min(wait_s, query_at_s_ - now_s);
      wait_s = std::min(wait_s, heard_at_s_ + options_.silence_s - now_s);
    }
    pollfd fds[2] = {{port_.fd(), static_cast<short>(POLLIN | (unsent_.empty() ? 0 : POLLOUT)), 0},
                     {wake_fd_, POLLIN, 0}};
    (void)poll(fds, 2, static_cast<int>(std::ceil(std::clamp(wait_s, 0.0, 1.0) * 1000)));
    if ((fds[1].revents & POLLIN) != 0) {
      uint64_t count;
      (void)!read(wake_fd_, &count, sizeof count);  // `done` looks what it is about
    }
    if ((fds[0].revents & POLLOUT) != 0) TOUCHSTONE_RETURN_IF_ERROR(Flush());
    if ((fds[0].revents & (POLLIN | POLLHUP | POLLERR | POLLNVAL)) != 0) {
      TOUCHSTONE_RETURN_IF_ERROR(ReadAll());
      if ((fds[0].revents & POLLIN) == 0)
        return absl::UnavailableError(absl::StrCat("serial port ", options_.port, ": the other end is gone"));
    }
  }
}

absl::Status SerialEffector::ReadAll() {
  uint8_t bytes[512];
  TOUCHSTONE_ASSIGN_OR_RETURN(const size_t size, port_.Read(bytes, sizeof bytes));
  const double host_s = HostNowS();
  for (size_t i = 0; i < size; ++i)
    if (parser_.Push(bytes[i])) Handle(parser_.payload(), parser_.size(), host_s);
  std::lock_guard<std::mutex> lock(mutex_);
  state_.bad_frames = damaged_ + parser_.bad_frames();
  return absl::OkStatus();
}

void SerialEffector::QueryClock() {
  const double now_s = HostNowS();
  query_at_s_ = now_s + options_.clock_query_s;
  if (!unsent_.empty()) return;  // it would wait behind others
  queries_[next_query_] = now_s;
  while (queries_.size() > 16) queries_.erase(queries_.begin());
  (void)Send(firmware::Clock{next_query_++});
}

void SerialEffector::Handle(const uint8_t* payload, size_t size, double host_s) {
  if (!firmware::IsIntact(payload, size)) {
    ++damaged_;
    return;
  }
  heard_at_s_ = host_s;
  firmware::Event event;
  firmware::ClockReply clock;
  firmware::Status status;
  if (firmware::Decode(payload, size, &event)) {
    if (greeted_) HandleEvent(event);
  } else if (firmware::Decode(payload, size, &clock)) {
    HandleClock(clock, size, host_s);
  } else if (firmware::Decode(payload, size, &status) && greeted_) {
    HandleStatus(status);
  }
  if (judge_ != nullptr && answer_ == Answer::kNo) answer_ = judge_(payload, size);
}

void SerialEffector::HandleClock(const firmware::ClockReply& reply, size_t payload_size, double host_s) {
  const auto query = queries_.find(reply.query);
  if (query == queries_.end() || state_.tick_hz == 0) return;
  // The device stamps the last byte that it gets and the first that it sends; here the first that is sent and
  // the last that comes are known. What the bytes take on a wire lies between.
  const size_t overhead = 4;  // CRC, one byte of COBS, delimiter
  uint8_t payload[firmware::kMaxPayload];
  const size_t query_size = firmware::Encode(firmware::Clock{}, payload);
  const double sent_s = query->second + (query_size + overhead) * port_.seconds_per_byte();
  const double came_s = host_s - (payload_size + overhead) * port_.seconds_per_byte();
  queries_.erase(query);
  const double tick_s = 1.0 / state_.tick_hz;
  sync_.AddRoundTrip(sent_s, reply.receive_ticks * tick_s, reply.send_ticks * tick_s, came_s);
  const ClockEstimate estimate = sync_.Estimate();
  std::lock_guard<std::mutex> lock(mutex_);
  clock_ = estimate;
}

void SerialEffector::HandleStatus(const firmware::Status& status) {
  bool changes = false;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    // One message may be damaged; two that tell the same are not.
    const bool other_boot = status.boot_id != state_.boot_id;
    const bool other_touch = record_.armed() && status.touch != record_.touch().touch;
    strange_statuses_ = other_boot || other_touch ? strange_statuses_ + 1 : 0;
    if (strange_statuses_ >= 3) {
      strange_statuses_ = 0;
      strange_ = other_boot ? "the device was reset" : "the device is no longer armed";
    }
    if (other_boot) return;
    for (size_t i = 0; i < state_.pressed.size(); ++i) {
      const bool pressed = (status.pressed_mask >> i & 1) != 0;
      changes |= pressed != state_.pressed[i];
      state_.pressed[i] = pressed;
    }
  }
  if (changes && changes_ != nullptr) changes_->Notify();
}

void SerialEffector::HandleEvent(const firmware::Event& event) {
  const uint64_t max_ticks = MaxTicks();
  ContactRecord::Verdict verdict;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    verdict = record_.Take(event, max_ticks);
    if (verdict == ContactRecord::Verdict::kRepeated) ++state_.repeated_events;
    if (verdict == ContactRecord::Verdict::kNews && event.finger < state_.pressed.size())
      state_.pressed[event.finger] = event.kind == firmware::EventKind::kContact;
  }
  if (verdict == ContactRecord::Verdict::kUnbelievable) return;
  if (verdict == ContactRecord::Verdict::kStale) {
    // An event whose touch was damaged looks stale: only what comes twice alike is done with.
    const firmware::Event& before = stale_event_;
    const bool twice = before.number == event.number && before.touch == event.touch &&
                       before.finger == event.finger && before.kind == event.kind &&
                       before.ticks == event.ticks;
    stale_event_ = event;
    if (!twice) return;
  }
  (void)Send(firmware::Acknowledge{event.number});
  if (verdict == ContactRecord::Verdict::kNews && changes_ != nullptr) changes_->Notify();
}

uint64_t SerialEffector::MaxTicks() const {
  if (!clock_.valid) return 0;
  const double ticks = (clock_.RemoteOf(HostNowS() + kSlackS)) * state_.tick_hz;
  return ticks > 0 ? static_cast<uint64_t>(ticks) : 0;
}

absl::Status SerialEffector::Converse() {
  const uint8_t delimiter = 0;  // ends whatever an earlier owner of the port began
  unsent_.assign(1, delimiter);
  heard_at_s_ = HostNowS();
  strange_.clear();
  TOUCHSTONE_RETURN_IF_ERROR(Greet());
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
    bool settle;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (work_ != nullptr && !work_done_) work = work_;
      settle = record_.WantsSettling();
    }
    if (settle) {
      TOUCHSTONE_RETURN_IF_ERROR(SettleTouch());
    } else if (work != nullptr) {
      absl::Status status = work();
      // Whoever does not answer is not there.
      if (absl::IsDeadlineExceeded(status)) status = absl::UnavailableError(status.message());
      {
        std::lock_guard<std::mutex> lock(mutex_);
        work_done_ = true;
        work_status_ = status;
      }
      changed_.notify_all();
      if (absl::IsUnavailable(status)) return status;
    } else {
      TOUCHSTONE_RETURN_IF_ERROR(Pump(HostNowS() + 1, [this] {
        std::lock_guard<std::mutex> lock(mutex_);
        return record_.WantsSettling() || (work_ != nullptr && !work_done_);
      }));
    }
  }
  return absl::OkStatus();
}

absl::Status SerialEffector::Greet() {
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
  return SayHello();
}

absl::StatusOr<bool> SerialEffector::Resume() {
  firmware::Status found;
  bool heard = false;
  TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::StatusRequest{}, [&](const uint8_t* payload, size_t size) {
    firmware::Status status;
    if (!firmware::Decode(payload, size, &status)) return Answer::kNo;
    // Twice the same, as anywhere that one damaged frame could decide.
    const bool twice = heard && status.boot_id == found.boot_id && status.touch == found.touch;
    found = status;
    heard = true;
    return twice ? Answer::kYes : Answer::kNo;
  }));
  if (found.boot_id != state_.boot_id || found.touch != record_.touch().touch) return false;
  greeted_ = true;
  return SettleTouch().ok();
}

absl::Status SerialEffector::SayHello() {
  firmware::Hello hello;
  hello.nonce = next_nonce_++;
  firmware::HelloReply reply;
  TOUCHSTONE_RETURN_IF_ERROR(Ask(hello, [&](const uint8_t* payload, size_t size) {
    firmware::HelloReply heard;
    if (!firmware::Decode(payload, size, &heard) || heard.nonce != hello.nonce) return Answer::kNo;
    reply = heard;
    return Answer::kYes;
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
      clock_ = ClockEstimate();
      if (unfinished)
        record_.Lose(absl::StrCat("the device was reset during touch ", record_.touch().touch,
                                  "; its record is gone"));
    }
  }
  if (!same_boot) sync_.Reset();
  greeted_ = true;
  query_at_s_ = 0;
  strange_statuses_ = 0;

  if (same_boot && unfinished) {
    // Hello disarmed it, so what is not in the record by now will never be.
    const absl::Status settled = SettleTouch();
    if (absl::IsUnavailable(settled) || absl::IsDeadlineExceeded(settled)) return settled;
    std::lock_guard<std::mutex> lock(mutex_);
    if (!record_.Final())
      record_.Lose(absl::StrCat("the device was disarmed during touch ", record_.touch().touch,
                                " while the line was lost"));
  }

  firmware::Configure configure;
  configure.fingers = static_cast<uint8_t>(options_.fingers.size());
  for (size_t i = 0; i < options_.fingers.size(); ++i) configure.finger[i] = ConfigOf(options_.fingers[i]);
  return Ask(configure, [&](const uint8_t* payload, size_t size) {
    firmware::Configured configured;
    return firmware::Decode(payload, size, &configured) && configured.fingers == configure.fingers
               ? Answer::kYes
               : Answer::kNo;
  });
}

absl::Status SerialEffector::ReadRecord(uint32_t touch,
                                        const std::function<bool(const firmware::Recalled&)>& take) {
  // Each try sends Recall once; `take` wants two answers that agree.
  for (int i = 0; i < kTries; ++i) {
    firmware::Recalled recalled;
    TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::Recall{touch}, [&](const uint8_t* payload, size_t size) {
      return firmware::Decode(payload, size, &recalled) && recalled.touch == touch ? Answer::kYes
                                                                                   : Answer::kNo;
    }));
    if (Stopping()) return absl::UnavailableError("the gateway ends");
    if (take(recalled)) return absl::OkStatus();
    // The clock may not be known yet, without which no time is believed.
    if (!clock_.valid)
      TOUCHSTONE_RETURN_IF_ERROR(
          Pump(HostNowS() + options_.reply_timeout_s, [this] { return clock_.valid; }));
  }
  return absl::UnavailableError(
      absl::StrCat("the device's records of touch ", touch, " contradict each other"));
}

absl::Status SerialEffector::SettleTouch() {
  const absl::Status status = ReadRecord(record_.touch().touch, [this](const firmware::Recalled& recalled) {
    const uint64_t max_ticks = MaxTicks();
    std::lock_guard<std::mutex> lock(mutex_);
    return record_.Settle(recalled, max_ticks);
  });
  if (absl::IsFailedPrecondition(status)) {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.Lose(absl::StrCat("the device has no record of touch ", record_.touch().touch, " any more"));
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
  return result;
}

absl::Status SerialEffector::ArmTouch(uint32_t touch) {
  // Times of events are believed only against the device's clock.
  const auto clock_known = [this] { return clock_.valid; };
  TOUCHSTONE_RETURN_IF_ERROR(Pump(HostNowS() + kTries * options_.reply_timeout_s, clock_known));
  if (!clock_known())
    return absl::DeadlineExceededError(absl::StrCat("the device at ", options_.port, " tells no time"));
  const double least = (clock_.RemoteOf(HostNowS() - kSlackS)) * state_.tick_hz;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.Begin(touch, state_.boot_id, static_cast<int>(options_.fingers.size()));
  }
  const absl::Status status = Ask(firmware::Arm{touch}, [&](const uint8_t* payload, size_t size) {
    firmware::Armed armed;
    if (!firmware::Decode(payload, size, &armed)) return Answer::kNo;
    const uint64_t max_ticks = MaxTicks();
    std::lock_guard<std::mutex> lock(mutex_);
    return record_.Arm(armed, least > 0 ? static_cast<uint64_t>(least) : 0, max_ticks) ? Answer::kYes
                                                                                       : Answer::kNo;
  });
  if (status.ok()) return status;
  std::string why(status.message());
  const bool refused = absl::IsFailedPrecondition(status);
  if (refused && refused_.reason == firmware::RefusedReason::kPressed) {
    std::vector<int> fingers;
    for (int i = 0; i < firmware::kMaxFingers; ++i)
      if ((refused_.detail >> i & 1) != 0) fingers.push_back(i + 1);
    why = absl::StrCat(fingers.size() == 1 ? "finger " : "fingers ", absl::StrJoin(fingers, ", "),
                       fingers.size() == 1 ? " is" : " are",
                       " pressed before the touch begins; retreat, or look whether something sticks");
  }
  std::lock_guard<std::mutex> lock(mutex_);
  record_.Lose(absl::StrCat("touch ", touch, " was not armed: ", why));
  // A device that forgot its configuration was reset: the conversation begins anew.
  if (refused && refused_.reason == firmware::RefusedReason::kNotConfigured)
    return absl::UnavailableError("end effector: the device was reset");
  return absl::Status(status.code(), absl::StrCat("end effector: ", why));
}

absl::Status SerialEffector::DisarmTouch() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    record_.Disarm();
  }
  TOUCHSTONE_RETURN_IF_ERROR(Ask(firmware::Disarm{}, [](const uint8_t* payload, size_t size) {
    firmware::Disarmed disarmed;
    return firmware::Decode(payload, size, &disarmed) ? Answer::kYes : Answer::kNo;
  }));
  const bool settle = record_.touch().touch != 0 && record_.lost().empty() && !record_.Final();
  return settle ? SettleTouch() : absl::OkStatus();
}

}  // namespace touchstone
