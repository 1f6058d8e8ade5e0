// touchstone.v1.Control and touchstone.v1.Rig of a rig.
#pragma once

#include "server/gateway/rig/rig.h"
#include "server/service/rpc/control_service.h"
#include "touchstone/v1/rig.grpc.pb.h"

namespace touchstone::service {

// Leases as everywhere; stopping and the state are the rig's.
class RigControlService final : public ControlService {
 public:
  RigControlService(Resources* resources, LeaseBook* leases, gateway::Rig* rig)
      : ControlService(resources, leases), rig_(rig) {}

  grpc::Status AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest*, v1::Lease*) override;
  grpc::Status ReleaseLease(grpc::ServerContext*, const v1::ReleaseLeaseRequest*,
                            v1::ReleaseLeaseResponse*) override;
  grpc::Status Stop(grpc::ServerContext*, const v1::StopRequest*, v1::StopResponse*) override;
  // Also ends the lease that stands.
  grpc::Status Reset(grpc::ServerContext*, const v1::ResetRequest*, v1::State*) override;
  grpc::Status GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State*) override;

 private:
  gateway::Rig* rig_;
};

class RigService final : public v1::Rig::Service {
 public:
  RigService(Resources* resources, LeaseBook* leases, gateway::Rig* rig)
      : resources_(resources), leases_(leases), rig_(rig) {}

  grpc::Status GetRig(grpc::ServerContext*, const v1::GetRigRequest*, v1::RigState*) override;
  grpc::Status CheckTouches(grpc::ServerContext*, const v1::CheckTouchesRequest*,
                            v1::CheckTouchesResponse*) override;
  grpc::Status CheckViews(grpc::ServerContext*, const v1::CheckViewsRequest*,
                          v1::CheckTouchesResponse*) override;
  grpc::Status MountObject(grpc::ServerContext*, const v1::MountObjectRequest*, v1::RigState*) override;
  grpc::Status PowerOn(grpc::ServerContext*, const v1::PowerOnRequest*, v1::RigState*) override;
  grpc::Status Home(grpc::ServerContext*, const v1::HomeRequest*, v1::RigState*) override;

 private:
  absl::Status DoCheck(const v1::CheckTouchesRequest& request, v1::CheckTouchesResponse* response);
  absl::Status DoCheck(const v1::CheckViewsRequest& request, v1::CheckTouchesResponse* response);
  absl::Status DoMount(grpc::ServerContext* context, const v1::MountObjectRequest& request);
  void Describe(v1::RigState* state) const;

  Resources* resources_;
  LeaseBook* leases_;
  gateway::Rig* rig_;
};

}  // namespace touchstone::service
