// touchstone.v1.Control of the virtual source.
#pragma once

#include "server/service/lease_book.h"
#include "server/service/resources.h"
#include "touchstone/v1/control.grpc.pb.h"

namespace touchstone::service {

// INVALID_ARGUMENT unless it says who and why.
absl::Status CheckReset(const v1::ResetRequest& request);

class ControlService : public v1::Control::Service {
 public:
  ControlService(Resources* resources, LeaseBook* leases) : resources_(resources), leases_(leases) {}

  grpc::Status AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest*, v1::Lease*) override;
  grpc::Status RenewLease(grpc::ServerContext*, const v1::RenewLeaseRequest*, v1::Lease*) override;
  grpc::Status ReleaseLease(grpc::ServerContext*, const v1::ReleaseLeaseRequest*,
                            v1::ReleaseLeaseResponse*) override;
  grpc::Status Stop(grpc::ServerContext*, const v1::StopRequest*, v1::StopResponse*) override;
  // A virtual source moves nothing, so no stop holds and there is nothing to release.
  grpc::Status Reset(grpc::ServerContext*, const v1::ResetRequest*, v1::State*) override;
  grpc::Status GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State*) override;

 protected:
  Resources* resources_;
  LeaseBook* leases_;
};

}  // namespace touchstone::service
