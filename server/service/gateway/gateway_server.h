// The physical source as one object: a rig, or a recorded session, behind the services.
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "server/service/gateway/gateway_options.h"
#include "server/source/rig_device.h"

namespace touchstone::service {

class GatewayServer {
 public:
  // Opens journal, calibration, arm, end effector and camera, reconciles what was interrupted, and listens.
  // Errors name the option or the file. An arm or end effector that does not answer yet is no error: GetState
  // shows it.
  static absl::StatusOr<std::unique_ptr<GatewayServer>> Start(GatewayOptions options);
  ~GatewayServer();

  int port() const;
  // For tests: the rig, or the recording.
  source::RigDevice& device();
  // Takes no more calls, reports NOT_SERVING, ends the motion under way, and waits up to drain_s for running
  // calls.
  void Drain();

 private:
  GatewayServer();
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace touchstone::service
