// touchstone.v1.Control of the virtual source, and the lease that it keeps.
#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include <absl/status/statusor.h>

#include "server/service/resources.h"
#include "touchstone/v1/control.grpc.pb.h"

namespace touchstone {

// One writer at a time, by a token that goes stale when another lease is granted or the window passes.
class LeaseBook {
 public:
  using Clock = std::chrono::steady_clock;
  explicit LeaseBook(double window_s) : window_s_(window_s) {}

  absl::StatusOr<v1::Lease> Acquire(const std::string& holder, bool take,
                                    Clock::time_point now = Clock::now());
  absl::StatusOr<v1::Lease> Renew(const std::string& token, Clock::time_point now = Clock::now());
  absl::Status Release(const std::string& token, Clock::time_point now = Clock::now());
  // Whether a request that carries `token` may act. A virtual source needs no lease, so none is right; a
  // stale one is refused.
  absl::Status Check(const std::string& token, Clock::time_point now = Clock::now()) const;

  // Who holds it; empty if nobody.
  std::string Holder(Clock::time_point now = Clock::now()) const;
  uint64_t epoch() const;

 private:
  bool Held(Clock::time_point now) const;
  absl::Status CheckToken(const std::string& token, Clock::time_point now) const;
  v1::Lease Describe() const;

  const double window_s_;
  mutable std::mutex mutex_;
  std::string token_, holder_;
  uint64_t epoch_ = 0;
  Clock::time_point until_{};
};

class ControlService final : public v1::Control::Service {
 public:
  ControlService(Resources* resources, LeaseBook* leases) : resources_(resources), leases_(leases) {}

  grpc::Status AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest*, v1::Lease*) override;
  grpc::Status RenewLease(grpc::ServerContext*, const v1::RenewLeaseRequest*, v1::Lease*) override;
  grpc::Status ReleaseLease(grpc::ServerContext*, const v1::ReleaseLeaseRequest*,
                            v1::ReleaseLeaseResponse*) override;
  grpc::Status Stop(grpc::ServerContext*, const v1::StopRequest*, v1::StopResponse*) override;
  grpc::Status GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State*) override;

 private:
  Resources* resources_;
  LeaseBook* leases_;
};

}  // namespace touchstone
