#include "server/service/connections/frame_meter.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "server/base/text/over_limit.h"

namespace touchstone::service {
namespace {

constexpr double kFramesSavedS = 5;
constexpr int kMaxUnanswered = 200;
constexpr size_t kMaxBlockFrames = 32;  // of one block; clients split it where a frame is full, at 16 KiB
// Payloads from this size on are limited by their bytes (flow control), not by their frames.
constexpr uint32_t kSmallData = 256;

// The path of Control.Stop in a block of headers: as it is, and in the Huffman code of RFC 7541, appendix B, which clients in
// Go and Java use. The first call of a connection cannot refer to an earlier one.
constexpr absl::string_view kStopPath = "/touchstone.v1.Control/Stop";
constexpr absl::string_view kStopPathHuffman(
    "\x61\x27\xb4\x93\xa1\x27\xa8\xab\xf7\x0a\xf7\x8f\x52\x6c\x3d\x0c\x6e\x49\xeb");

bool CallsStop(absl::string_view block) {
  return absl::StrContains(block, kStopPath) || absl::StrContains(block, kStopPathHuffman);
}

}  // namespace

FrameMeter::FrameMeter(const Limits& limits, SharedResets* shared,
                       std::shared_ptr<AddressCalls> address_calls, Clock::Time now, bool only_stop)
    : limits_(limits),
      shared_(shared),
      address_calls_(std::move(address_calls)),
      only_stop_(only_stop),
      resets_(limits.max_resets_per_s, SharedResets::kSavedS, now),
      pings_(limits.max_pings_per_s, kFramesSavedS, now),
      frames_(limits.max_frames_per_s, kFramesSavedS, now) {}

FrameMeter::Verdict FrameMeter::Shut(std::string reason) {
  reason_ = std::move(reason);
  return Verdict::kShut;
}

FrameMeter::Verdict FrameMeter::TakeFrom(bool taken, const char* limit) {
  if (taken) return Verdict::kPass;
  waits_for_ = limit;
  return Verdict::kLater;
}

FrameMeter::Verdict FrameMeter::FromClient(const FrameHead& head, absl::string_view payload,
                                           Clock::Time now) {
  resets_.Fill(now);
  const Verdict verdict = Check(head, payload, now);
  if (verdict != Verdict::kLater) return verdict;
  if (!waiting_) waiting_since_ = now;
  waiting_ = true;
  const double waited_s = std::chrono::duration<double>(now - waiting_since_).count();
  if (waited_s <= limits_.flood_s) return verdict;
  return Shut(absl::StrCat("it has asked for more than ", waits_for_,
                           " allows for longer than flood_s = ", LimitInWords(limits_.flood_s), " s"));
}

FrameMeter::Verdict FrameMeter::Check(const FrameHead& head, absl::string_view payload, Clock::Time now) {
  switch (head.type) {
    case FrameType::kData:
      if (head.Has(kEndStream) || head.length >= kSmallData) return Verdict::kPass;
      // No client has a reason for a frame of nothing.
      if (head.length == 0) return TakeFrom(pings_.Take(now), "max_pings_per_s");
      break;
    case FrameType::kHeaders:
    case FrameType::kContinuation: {
      const Verdict verdict = CheckBlock(head, payload);
      if (verdict != Verdict::kPass) return verdict;
      if (TakeFrom(frames_.Take(now), "max_frames_per_s") == Verdict::kLater) return Verdict::kLater;
      Count(head);
      return Verdict::kPass;
    }
    case FrameType::kRstStream: {
      if (open_.count(head.stream) == 0) break;  // it has ended already
      const Verdict verdict = TakeFrom(resets_.Take(now) && shared_->Take(now), "max_resets_per_s");
      if (verdict == Verdict::kPass) EndCall(head.stream);
      return verdict;
    }
    case FrameType::kWindowUpdate:
      break;
    default:  // PING, SETTINGS, PRIORITY and what is no type
      // gRPC keeps its answers for a client that does not read them.
      if (unanswered_ >= kMaxUnanswered) return TakeFrom(false, "max_pings_per_s");
      if (pings_.Take(now)) {
        ++unanswered_;
        return Verdict::kPass;
      }
      return TakeFrom(false, "max_pings_per_s");
  }
  return TakeFrom(frames_.Take(now), "max_frames_per_s");
}

FrameMeter::Verdict FrameMeter::CheckBlock(const FrameHead& head, absl::string_view payload) {
  const bool begins = head.type == FrameType::kHeaders;
  if (begins && only_stop_) {
    if (last_stream_ != 0)
      return Shut("it was for one call of Control.Stop: its address has all others in use");
    if (payload.size() < head.length) return TakeFrom(false, "max_connections_per_address");
    if (!CallsStop(payload))
      return Shut(
          "its address has all connections in use (max_connections_per_address): one more is for "
          "Control.Stop "
          "alone");
  }
  // Calls that the server itself resets, for what is wrong with their frames, are its client's resets too.
  if (begins && resets_.in_debt()) return TakeFrom(false, "max_resets_per_s");
  // A connection's only call always passes: it may be a stop.
  if (begins && !open_.empty() && *address_calls_ >= limits_.max_calls_per_address)
    return TakeFrom(false, "max_calls_per_address");
  if ((begins ? 0 : block_bytes_) + head.length > static_cast<size_t>(limits_.max_header_kib) << 10)
    return Shut(absl::StrCat("the headers of a call have more than ", limits_.max_header_kib,
                             " KiB (max_header_kib)"));
  if (!begins && block_frames_ >= kMaxBlockFrames)
    return Shut(absl::StrCat("the headers of a call come in more than ", kMaxBlockFrames, " frames"));
  return Verdict::kPass;
}

void FrameMeter::Count(const FrameHead& head) {
  const bool begins = head.type == FrameType::kHeaders;
  block_bytes_ = (begins ? 0 : block_bytes_) + head.length;
  block_frames_ = (begins ? 0 : block_frames_) + 1;
  if (!begins || head.stream <= last_stream_) return;
  last_stream_ = head.stream;
  *address_calls_ += open_.insert(head.stream).second ? 1 : 0;
}

bool FrameMeter::EndCall(uint32_t stream) {
  if (open_.erase(stream) == 0) return false;
  --*address_calls_;
  return true;
}

void FrameMeter::FromServer(const FrameHead& head) {
  if (head.type == FrameType::kRstStream && EndCall(head.stream)) resets_.Charge();
  if ((head.type == FrameType::kHeaders || head.type == FrameType::kData) && head.Has(kEndStream))
    EndCall(head.stream);
}

}  // namespace touchstone::service
