// Who may use how much of a server at once: places, memory, and time in which nothing moves.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <grpcpp/server_context.h>

#include "server/base/threads/clock.h"
#include "server/service/connections/token_bucket.h"

namespace touchstone::service {

// Who calls, as limits of one client count: the address without its port, "ipv4:10.0.0.7", "inproc".
std::string ClientOf(const grpc::ServerContext& context);
std::string ClientOfPeer(const std::string& peer);

// So many of something at once, together and for each client. Thread-safe.
class Places {
 public:
  // "16 sessions are being sent already (max_uploads = 16)": `what` is "sessions are being sent", `limit` its name. No
  // limit for each client where max_per_client is 0.
  Places(std::string what, std::string limit, int max, std::string client_limit = "", int max_per_client = 0);

  // Taken while it lives.
  class Place {
   public:
    Place(Places* places, std::string client) : places_(places), client_(std::move(client)) {}
    Place(Place&& other) noexcept : places_(other.places_), client_(std::move(other.client_)) {
      other.places_ = nullptr;
    }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    ~Place() {
      if (places_ != nullptr) places_->Leave(client_);
    }

   private:
    Places* places_;
    std::string client_;
  };
  // RESOURCE_EXHAUSTED names the limit: all are taken, or all that one client may have.
  absl::StatusOr<Place> Take(const std::string& client);
  uint32_t taken() const { return taken_; }

 private:
  void Leave(const std::string& client);

  const std::string what_, limit_, client_limit_;
  const int max_, max_per_client_;
  std::mutex mutex_;
  std::map<std::string, int> by_client_;
  std::atomic<uint32_t> taken_{0};
};

// So many calls a second of each client; what it did not use in the last seconds is saved up. Thread-safe.
class CallRate {
 public:
  explicit CallRate(int max_per_s, const Clock& clock = SteadyClock());  // 0: any number
  // RESOURCE_EXHAUSTED names the limit; clients wait and try again.
  absl::Status Take(const std::string& client);

 private:
  const double max_per_s_;
  const Clock& clock_;
  std::mutex mutex_;
  std::map<std::string, TokenBucket> by_client_;
};

// What the process may use beyond what it has when it begins to serve. Thread-safe.
class MemoryBudget {
 public:
  // 0: half of what the process may have (MemoryLimitBytes).
  explicit MemoryBudget(int max_mib);
  // What is resident now belongs to no client.
  void Begin();
  uint64_t bytes() const { return max_bytes_; }

  class Reservation {
   public:
    Reservation(MemoryBudget* budget, uint64_t bytes) : budget_(budget), bytes_(bytes) {}
    Reservation(Reservation&& other) noexcept : budget_(other.budget_), bytes_(other.bytes_) {
      other.budget_ = nullptr;
    }
    Reservation(const Reservation&) = delete;
    Reservation& operator=(const Reservation&) = delete;
    ~Reservation() {
      if (budget_ != nullptr) budget_->reserved_ -= bytes_;
    }
    // So many bytes more, under the conditions of Reserve.
    absl::Status Grow(uint64_t bytes);

   private:
    MemoryBudget* budget_;
    uint64_t bytes_;
  };
  // For what is about to be made. RESOURCE_EXHAUSTED: what is reserved would be more than the budget, or what the process
  // has is.
  absl::StatusOr<Reservation> Reserve(uint64_t bytes);

 private:
  bool ResidentIsTooMuch();

  const uint64_t max_bytes_;
  std::atomic<uint64_t> begin_bytes_{0}, reserved_{0};
  std::mutex trim_mutex_;
  std::chrono::steady_clock::time_point trimmed_{};
};

// Cancels calls whose client has neither taken nor sent anything for too long, so that they give back what they hold.
class StallWatch {
 public:
  explicit StallWatch(double stall_s, const Clock& clock = SteadyClock());
  ~StallWatch();

  // One call while it lives. Not for several threads.
  class Call {
   public:
    Call(StallWatch* watch, grpc::ServerContext* context);
    ~Call();
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    // Runs a read or a write, which may block; what it gives.
    template <typename Io>
    bool Wait(Io io) {
      SetWaiting(true);
      const bool done = io();
      SetWaiting(false);
      return done;
    }

   private:
    friend class StallWatch;
    void SetWaiting(bool waiting);
    StallWatch* const watch_;
    grpc::ServerContext* const context_;
    bool waiting_ = false;  // with watch_->mutex_
    Clock::Time since_;
  };

 private:
  void Run();

  const double stall_s_;
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::set<Call*> calls_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace touchstone::service
