// touchstone.v1.Rig and .Control of a bug report that is served again (gateway/bundle/replay.h): they say how the rig was,
// and move nothing.
#pragma once

#include <mutex>

#include "server/gateway/bundle/replay.h"
#include "server/service/rpc/control_service.h"
#include "touchstone/v1/rig.grpc.pb.h"

namespace touchstone::service {

// What people change on it (the object, a stop) they change in its memory.
class ReplayRigService final : public v1::Rig::Service {
 public:
  ReplayRigService(Resources* resources, LeaseBook* leases, const gateway::bundle::Replay& replay,
                   source::RecordedRig* recorded)
      : resources_(resources), leases_(leases), rig_(replay.rig), name_(replay.name), recorded_(recorded) {
    // Nobody has to put anything down, nor to keep clear of an arm.
    rig_.set_mounts_itself(true);
  }

  grpc::Status GetRig(grpc::ServerContext*, const v1::GetRigRequest*, v1::RigState*) override;
  // Possible is what the record has an answer to.
  grpc::Status CheckTouches(grpc::ServerContext*, const v1::CheckTouchesRequest*,
                            v1::CheckTouchesResponse*) override;
  grpc::Status CheckViews(grpc::ServerContext*, const v1::CheckViewsRequest*,
                          v1::CheckTouchesResponse*) override;
  // Notes the object.
  grpc::Status MountObject(grpc::ServerContext*, const v1::MountObjectRequest*, v1::RigState*) override;
  // FAILED_PRECONDITION.
  grpc::Status PowerOn(grpc::ServerContext*, const v1::PowerOnRequest*, v1::RigState*) override;
  grpc::Status Home(grpc::ServerContext*, const v1::HomeRequest*, v1::RigState*) override;

 private:
  absl::Status DoCheck(const v1::CheckTouchesRequest& request, v1::CheckTouchesResponse* response);
  absl::Status DoCheck(const v1::CheckViewsRequest& request, v1::CheckTouchesResponse* response);
  absl::Status NothingMoves() const;

  Resources* resources_;
  LeaseBook* leases_;
  std::mutex mutex_;  // of rig_
  v1::RigState rig_;
  const std::string name_;
  source::RecordedRig* recorded_;
};

class ReplayControlService final : public ControlService {
 public:
  ReplayControlService(Resources* resources, LeaseBook* leases, const gateway::bundle::Replay& replay)
      : ControlService(resources, leases), has_state_(replay.has_state), state_(replay.state) {}

  grpc::Status Reset(grpc::ServerContext*, const v1::ResetRequest*, v1::State*) override;
  // As it was when the bundle was made, but for the lease and what runs now.
  grpc::Status GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State*) override;

 private:
  const bool has_state_;
  std::mutex mutex_;  // of state_
  v1::State state_;
};

}  // namespace touchstone::service
