// What a connection asks of an HTTP/2 server, counted frame by frame before the server sees it. gRPC 1.51 lets a client begin
// calls and reset them without end (CVE-2023-44487), and has no limit to heads that do not end, pings or settings.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include <absl/strings/string_view.h>

#include "server/service/connections/frame_reader.h"
#include "server/service/connections/token_bucket.h"
#include "server/service/options/limits.h"

namespace touchstone::service {

// The resets of all connections of a process together, which share what gRPC can clear away. Thread-safe.
class SharedResets {
 public:
  static constexpr double kConnections = 4;  // that may reset calls as fast as one connection may
  static constexpr double kSavedS = 1;       // what gRPC has not cleared away takes some 20 KiB a call
  SharedResets(const Limits& limits, Clock::Time now)
      : bucket_(kConnections * limits.max_resets_per_s, kSavedS, now) {}
  bool Take(Clock::Time now) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return bucket_.Take(now);
  }

 private:
  std::mutex mutex_;
  TokenBucket bucket_;
};

// Not for several threads.
class FrameMeter {
 public:
  // Calls under way on all connections of an address.
  using AddressCalls = std::atomic<int>;

  // `limits` and `shared` outlive it. `only_stop`: its first call must be Control.Stop, and there is no second one.
  FrameMeter(const Limits& limits, SharedResets* shared, std::shared_ptr<AddressCalls> address_calls,
             Clock::Time now, bool only_stop);
  ~FrameMeter() { *address_calls_ -= static_cast<int>(open_.size()); }
  FrameMeter(const FrameMeter&) = delete;
  FrameMeter& operator=(const FrameMeter&) = delete;

  enum class Verdict {
    kPass,
    kLater,  // the client is read no further until then
    kShut,   // reason() says why
  };
  Verdict FromClient(const FrameHead& head, absl::string_view payload, Clock::Time now);
  void FromServer(const FrameHead& head);

  // The client has taken answers, or none wait for it.
  void AnswersMove() { unanswered_ = 0; }

  // Calls begun and not ended by either side.
  size_t open_calls() const { return open_.size(); }
  uint32_t last_stream() const { return last_stream_; }
  const std::string& reason() const { return reason_; }
  // A client that has waited since then, without a pause, for longer than flood_s is shut out; it no longer waits.
  void NothingWaits() { waiting_ = false; }

 private:
  Verdict Check(const FrameHead& head, absl::string_view payload, Clock::Time now);
  Verdict CheckBlock(const FrameHead& head, absl::string_view payload);
  void Count(const FrameHead& head);
  bool EndCall(uint32_t stream);  // whether it was open
  Verdict Shut(std::string reason);
  Verdict TakeFrom(bool taken, const char* limit);

  const Limits& limits_;
  SharedResets* const shared_;
  const std::shared_ptr<AddressCalls> address_calls_;
  const bool only_stop_;
  TokenBucket resets_, pings_, frames_;
  std::set<uint32_t> open_;                    // streams
  uint32_t last_stream_ = 0;                   // of the client
  size_t block_bytes_ = 0, block_frames_ = 0;  // of the block of headers that is coming
  int unanswered_ = 0;                         // frames that ask for an answer, while the client takes none
  bool waiting_ = false;
  Clock::Time waiting_since_{};
  const char* waits_for_ = "";  // the limit
  std::string reason_;
};

}  // namespace touchstone::service
