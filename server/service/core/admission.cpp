#include "server/service/core/admission.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <malloc.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "server/base/process/memory_limit.h"
#include "server/base/text/over_limit.h"
#include "server/service/connections/relayed_peer.h"
#include "server/service/options/limits.h"

namespace touchstone::service {
namespace {

uint64_t ResidentBytes() {
  uint64_t pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

constexpr double kSavedS = 5;            // of calls that were not made
constexpr size_t kManyClients = 10'000;  // then those who have everything saved are forgotten

}  // namespace

std::string ClientOfPeer(const std::string& transport_peer) {
  const std::string peer = PeerOfTransport(transport_peer);
  if (!absl::StartsWith(peer, "ipv")) return peer.substr(0, peer.find(':'));
  return peer.substr(0, peer.rfind(':'));
}

std::string ClientOf(const grpc::ServerContext& context) {
  return ClientOfPeer(context.peer());
}

Places::Places(std::string what, std::string limit, int max, std::string client_limit, int max_per_client)
    : what_(std::move(what)),
      limit_(std::move(limit)),
      client_limit_(std::move(client_limit)),
      max_(max),
      max_per_client_(max_per_client) {}

absl::StatusOr<Places::Place> Places::Take(const std::string& client) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (taken_ >= static_cast<uint32_t>(max_))
    return Busy(absl::StrCat(taken_.load(), " ", what_), limit_, max_);
  const auto found = by_client_.find(client);
  const int own = found == by_client_.end() ? 0 : found->second;
  if (max_per_client_ > 0 && own >= max_per_client_)
    return Busy(absl::StrCat("for ", client, " ", own, " ", what_), client_limit_, max_per_client_);
  ++by_client_[client];
  ++taken_;
  return Place(this, client);
}

void Places::Leave(const std::string& client) {
  std::lock_guard<std::mutex> lock(mutex_);
  --taken_;
  const auto found = by_client_.find(client);
  if (--found->second == 0) by_client_.erase(found);
}

CallRate::CallRate(int max_per_s, const Clock& clock) : max_per_s_(max_per_s), clock_(clock) {}

absl::Status CallRate::Take(const std::string& client) {
  if (max_per_s_ == 0) return absl::OkStatus();
  const auto now = clock_.Now();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (by_client_.size() >= kManyClients)
    for (auto each = by_client_.begin(); each != by_client_.end();)
      each = each->second.full(now) ? by_client_.erase(each) : std::next(each);
  if (by_client_.emplace(client, TokenBucket(max_per_s_, kSavedS, now)).first->second.Take(now))
    return absl::OkStatus();
  return Busy(absl::StrCat(client, " has made its calls of this second"), "max_unary_calls_per_s",
              max_per_s_);
}

MemoryBudget::MemoryBudget(int max_mib)
    : max_bytes_(max_mib > 0 ? max_mib * kMebibyte : MemoryLimitBytes() / 2) {}

void MemoryBudget::Begin() {
  // What was freed before may be given back later, and would then look like room.
  ::malloc_trim(0);
  begin_bytes_ = ResidentBytes();
}

// What was freed may still be resident: it is given back to the system, not more often than once a second.
bool MemoryBudget::ResidentIsTooMuch() {
  if (ResidentBytes() <= begin_bytes_ + max_bytes_) return false;
  std::lock_guard<std::mutex> lock(trim_mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (now - trimmed_ > std::chrono::seconds(1)) {
    ::malloc_trim(0);
    trimmed_ = now;
  }
  return ResidentBytes() > begin_bytes_ + max_bytes_;
}

absl::StatusOr<MemoryBudget::Reservation> MemoryBudget::Reserve(uint64_t bytes) {
  const uint64_t reserved = reserved_ += bytes;
  Reservation reservation(this, bytes);
  if (reserved > max_bytes_)
    return Busy(absl::StrCat((reserved - bytes) / kMebibyte, " MiB are used and ", bytes / kMebibyte + 1,
                             " more would be needed"),
                "max_memory_mib", static_cast<double>(max_bytes_ / kMebibyte));
  if (ResidentIsTooMuch())
    return Busy(
        absl::StrCat((ResidentBytes() - std::min<uint64_t>(ResidentBytes(), begin_bytes_)) / kMebibyte,
                     " MiB are used"),
        "max_memory_mib", static_cast<double>(max_bytes_ / kMebibyte));
  return reservation;
}

absl::Status MemoryBudget::Reservation::Grow(uint64_t bytes) {
  absl::StatusOr<Reservation> more = budget_->Reserve(bytes);
  if (!more.ok()) return more.status();
  bytes_ += std::exchange(more->bytes_, 0);
  return absl::OkStatus();
}

StallWatch::StallWatch(double stall_s, const Clock& clock)
    : stall_s_(stall_s), clock_(clock), thread_([this] { Run(); }) {}

StallWatch::~StallWatch() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void StallWatch::Run() {
  const double pause_s = std::min(stall_s_ / 4, 1.0);
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    wake_.wait(lock, [this] { return stopping_ || !calls_.empty(); });
    clock_.WaitFor(lock, wake_, pause_s, [this] { return stopping_; });
    const auto now = clock_.Now();
    for (Call* call : calls_) {
      if (!call->waiting_ || std::chrono::duration<double>(now - call->since_).count() <= stall_s_) continue;
      spdlog::warn("{}: nothing moved for {} s (stall_s): the call is cancelled", PeerOf(*call->context_),
                   stall_s_);
      call->context_->TryCancel();
      call->since_ = now;
    }
  }
}

StallWatch::Call::Call(StallWatch* watch, grpc::ServerContext* context) : watch_(watch), context_(context) {
  std::lock_guard<std::mutex> lock(watch_->mutex_);
  watch_->calls_.insert(this);
  watch_->wake_.notify_all();
}

StallWatch::Call::~Call() {
  std::lock_guard<std::mutex> lock(watch_->mutex_);
  watch_->calls_.erase(this);
}

void StallWatch::Call::SetWaiting(bool waiting) {
  std::lock_guard<std::mutex> lock(watch_->mutex_);
  waiting_ = waiting;
  since_ = watch_->clock_.Now();
}

}  // namespace touchstone::service
