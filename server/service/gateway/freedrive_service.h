// touchstone.v1.Freedrive of a rig.
#pragma once

#include "server/gateway/rig/rig.h"
#include "server/service/calls/lease_book.h"
#include "server/service/core/resources.h"
#include "touchstone/v1/freedrive.grpc.pb.h"

namespace touchstone::service {

class FreedriveService final : public v1::Freedrive::Service {
 public:
  FreedriveService(Resources* resources, LeaseBook* leases, gateway::Rig* rig)
      : resources_(resources), leases_(leases), rig_(rig) {}

  grpc::Status Guide(grpc::ServerContext*, const v1::GuideRequest*,
                     grpc::ServerWriter<v1::GuideState>*) override;

 private:
  v1::GuideState StateOf(const gateway::arm::ArmState& arm) const;

  Resources* resources_;
  LeaseBook* leases_;
  gateway::Rig* rig_;
};

}  // namespace touchstone::service
