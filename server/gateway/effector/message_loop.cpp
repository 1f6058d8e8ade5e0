// What goes over the serial line in both directions: requests and their replies, events, clock and status.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/gateway/effector/serial_effector.h"

namespace touchstone::gateway::effector {
namespace {

constexpr size_t kMaxUnsent = 4096;

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

absl::Status SerialEffector::SendPayload(const uint8_t* payload, size_t size) {
  uint8_t frame[firmware::kMaxFrame];
  const size_t frame_size = firmware::EncodeFrame(payload, size, frame);
  if (unsent_.size() > kMaxUnsent)
    return absl::UnavailableError(absl::StrCat("serial port ", options_.port, " takes no more bytes"));
  unsent_.insert(unsent_.end(), frame, frame + frame_size);
  return Flush();
}

absl::Status SerialEffector::Flush() {
  if (unsent_.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const size_t written, port_.Write(unsent_.data(), unsent_.size()));
  unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(written));
  return absl::OkStatus();
}

// Frames of the request and of its reply are damaged now and then: a refusal that makes no sense is a damaged
// request, and the request is sent again.
absl::Status SerialEffector::AskPayload(const uint8_t* payload, size_t payload_size,
                                        const ReplyMatcher& matcher) {
  const uint8_t type = payload[0];
  refused_ = firmware::Refused();
  reply_ = Reply::kNo;
  matcher_ = [&](const uint8_t* reply, size_t size) {
    firmware::Refused refused;
    if (!firmware::Decode(reply, size, &refused)) return matcher(reply, size);
    if (refused.type != type) return Reply::kNo;
    refused_ = refused;
    const bool senseless = refused.reason == firmware::RefusedReason::kUnknownType ||
                           refused.reason == firmware::RefusedReason::kBadLength ||
                           refused.reason == firmware::RefusedReason::kBadValue;
    return senseless ? Reply::kNo : Reply::kRefused;
  };
  absl::Status status;
  for (int i = 0; i < kTries && status.ok() && reply_ == Reply::kNo && !Stopping(); ++i) {
    status = SendPayload(payload, payload_size);
    if (status.ok())
      status = Pump(timing::HostNowS() + options_.reply_timeout_s, [this] { return reply_ != Reply::kNo; });
  }
  matcher_ = nullptr;
  if (!status.ok() || reply_ == Reply::kYes) return status;
  if (reply_ == Reply::kRefused || refused_.type == type)
    return absl::FailedPreconditionError(absl::StrCat("the device refuses message ", static_cast<int>(type),
                                                      ": ", ReasonText(refused_.reason)));
  return absl::DeadlineExceededError(absl::StrCat("no answer at ", options_.port, " to message ",
                                                  static_cast<int>(type), " in ", kTries, " tries of ",
                                                  options_.reply_timeout_s, " s; is this the right port?"));
}

absl::Status SerialEffector::Pump(double until_host_s, const std::function<bool()>& done) {
  for (bool first = true;; first = false) {
    if (done != nullptr && done()) return absl::OkStatus();
    if (!session_error_.empty()) return absl::UnavailableError(std::exchange(session_error_, ""));
    double now_s = timing::HostNowS();
    if (!first && (now_s >= until_host_s || Stopping())) return absl::OkStatus();
    if (now_s - heard_at_s_ > options_.silence_s && handshake_done_)
      return absl::UnavailableError(
          absl::StrCat("nothing was heard at ", options_.port, " for ", options_.silence_s, " s"));
    if (handshake_done_ && now_s >= query_at_s_) QueryClock();

    double wait_s = until_host_s - now_s;
    if (handshake_done_) {
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
  const double host_s = timing::HostNowS();
  for (size_t i = 0; i < size; ++i)
    if (parser_.Push(bytes[i])) Handle(parser_.payload(), parser_.size(), host_s);
  std::lock_guard<std::mutex> lock(mutex_);
  state_.bad_frames = damaged_ + parser_.bad_frames();
  return absl::OkStatus();
}

void SerialEffector::QueryClock() {
  const double now_s = timing::HostNowS();
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
    if (handshake_done_) HandleEvent(event);
  } else if (firmware::Decode(payload, size, &clock)) {
    HandleClock(clock, size, host_s);
  } else if (firmware::Decode(payload, size, &status) && handshake_done_) {
    HandleStatus(status);
  }
  if (matcher_ != nullptr && reply_ == Reply::kNo) reply_ = matcher_(payload, size);
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
  const timing::ClockEstimate estimate = sync_.Estimate();
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
    unexpected_statuses_ = other_boot || other_touch ? unexpected_statuses_ + 1 : 0;
    if (unexpected_statuses_ >= 3) {
      unexpected_statuses_ = 0;
      session_error_ = other_boot ? "the device was reset" : "the device is no longer armed";
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
    verdict = record_.OnEvent(event, max_ticks);
    if (verdict == ContactRecord::Verdict::kRepeated) ++state_.repeated_events;
    if (verdict == ContactRecord::Verdict::kNew && event.finger < state_.pressed.size())
      state_.pressed[event.finger] = event.kind == firmware::EventKind::kContact;
  }
  if (verdict == ContactRecord::Verdict::kRejected) return;
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
  if (verdict == ContactRecord::Verdict::kNew && changes_ != nullptr) changes_->Notify();
}

uint64_t SerialEffector::MaxTicks() const {
  if (!clock_.valid) return 0;
  const double ticks = (clock_.RemoteOf(timing::HostNowS() + kClockSlackS)) * state_.tick_hz;
  return ticks > 0 ? static_cast<uint64_t>(ticks) : 0;
}

}  // namespace touchstone::gateway::effector
