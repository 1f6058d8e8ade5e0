// Who may move a source: the lease that touchstone.v1.Control grants.
#pragma once

#include <mutex>
#include <string>

#include <absl/status/statusor.h>

#include "server/base/threads/clock.h"
#include "server/service/core/access.h"
#include "touchstone/v1/control.pb.h"

namespace touchstone::service {

// Of who asks and of why, as they are sent; of printable text in one line.
inline constexpr size_t kMaxHolderBytes = 256, kMaxReasonBytes = 256;

// One writer at a time, by a token that goes stale when another lease is granted or the window passes.
class LeaseBook {
 public:
  explicit LeaseBook(double window_s, bool required = false, const Clock& clock = SteadyClock())
      : window_s_(window_s), required_(required), clock_(clock) {}

  // `holder` is what the caller says of itself; who it was found to be stands behind that for others to see.
  absl::StatusOr<v1::Lease> Acquire(const std::string& holder, bool take, const Caller& caller = {});
  absl::StatusOr<v1::Lease> Renew(const std::string& token);
  // Ends whatever lease stands: its token is stale from now on.
  void Revoke();
  absl::Status Release(const std::string& token);
  // Whether a request that carries `token` may act. A stale one is refused. None is right at a virtual
  // source, which needs no lease; at a physical one that is refused too.
  absl::Status Check(const std::string& token) const;

  // Whether nobody may act without a lease.
  bool required() const { return required_; }
  // Who holds it; empty if nobody.
  std::string Holder() const;
  uint64_t epoch() const;

 private:
  // With mutex_.
  bool Held() const;
  absl::Status CheckToken(const std::string& token) const;
  v1::Lease Describe() const;

  const double window_s_;
  const bool required_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  std::string token_, holder_;
  uint64_t epoch_ = 0;
  Clock::Time until_{};
};

}  // namespace touchstone::service
