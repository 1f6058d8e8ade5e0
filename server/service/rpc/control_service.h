// touchstone.v1.Control of the virtual source.
#pragma once

#include "server/service/calls/call_queue.h"
#include "server/service/calls/lease_book.h"
#include "server/service/core/resources.h"
#include "touchstone/v1/control.grpc.pb.h"

namespace touchstone::service {

// INVALID_ARGUMENT unless it says who and why.
absl::Status CheckReset(const v1::ResetRequest& request);

// Its methods as calls of a CallQueue.
using QueuedControl = v1::Control::WithRawMethod_AcquireLease<v1::Control::WithRawMethod_RenewLease<
    v1::Control::WithRawMethod_ReleaseLease<v1::Control::WithRawMethod_Stop<
        v1::Control::WithRawMethod_Reset<v1::Control::WithRawMethod_GetState<v1::Control::Service>>>>>>;

class ControlService : public QueuedControl {
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

  // Stops, and all the rest: stops wait for nothing else.
  std::vector<CallQueue::Method> StopMethods();
  std::vector<CallQueue::Method> OtherMethods();

 protected:
  Resources* resources_;
  LeaseBook* leases_;
};

}  // namespace touchstone::service
