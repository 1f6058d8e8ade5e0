// Who may move a source: the lease that touchstone.v1.Control grants.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include <absl/status/statusor.h>

#include "server/service/access.h"
#include "touchstone/v1/control.pb.h"

namespace touchstone::service {

// Of who asks and of why, as they are sent; of printable text in one line.
inline constexpr size_t kMaxHolderBytes = 256, kMaxReasonBytes = 256;

// One writer at a time, by a token that goes stale when another lease is granted or the window passes.
class LeaseBook {
 public:
  using Clock = std::chrono::steady_clock;
  explicit LeaseBook(double window_s, bool required = false) : window_s_(window_s), required_(required) {}

  // `holder` is what the caller says of itself; who it was found to be stands behind that for others to see.
  absl::StatusOr<v1::Lease> Acquire(const std::string& holder, bool take, const Caller& caller = {},
                                    Clock::time_point now = Clock::now());
  absl::StatusOr<v1::Lease> Renew(const std::string& token, Clock::time_point now = Clock::now());
  // Ends whatever lease stands: its token is stale from now on.
  void Revoke();
  absl::Status Release(const std::string& token, Clock::time_point now = Clock::now());
  // Whether a request that carries `token` may act. A stale one is refused. None is right at a virtual
  // source, which needs no lease; at a physical one that is refused too.
  absl::Status Check(const std::string& token, Clock::time_point now = Clock::now()) const;

  // Whether nobody may act without a lease.
  bool required() const { return required_; }
  // Who holds it; empty if nobody.
  std::string Holder(Clock::time_point now = Clock::now()) const;
  uint64_t epoch() const;

 private:
  bool Held(Clock::time_point now) const;
  absl::Status CheckToken(const std::string& token, Clock::time_point now) const;
  v1::Lease Describe() const;

  const double window_s_;
  const bool required_;
  mutable std::mutex mutex_;
  std::string token_, holder_;
  uint64_t epoch_ = 0;
  Clock::time_point until_{};
};

}  // namespace touchstone::service
