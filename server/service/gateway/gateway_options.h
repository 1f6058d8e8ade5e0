// Everything that can be set about a physical source. Each field is a key of the gateway's TOML file, in the
// table that its group is named after, and a flag of touchstone-gateway.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/gateway/arm/kinematics/motion_limits.h"
#include "server/gateway/camera/camera.h"
#include "server/gateway/effector/effector.h"
#include "server/service/options/server_options.h"

namespace touchstone::service {

struct ArmOptions {
  std::string model = "ur3e";  // a name of arm_model.h
  std::string address;         // "192.168.0.10"
  int dashboard_port = 29999, primary_port = 30001, secondary_port = 30002, rtde_port = 30004;
  double silence_s = 0.5;  // host time without a state: the controller counts as frozen
  double watchdog_hz = 4;  // the controller stops the arm if this gateway beats more slowly
};

struct GatewayOptions {
  ServerOptions common;  // listen, meshes, limits, lease window, drain
  std::string replay;    // a journal, or a bundle (gateway/bundle/), to serve instead of a rig
  std::string journal = "rig.db";
  std::string audit_log = "rig.audit.jsonl";
  std::string calibration = "calibration.yaml";
  std::string provenance_note;
  bool emulated = false;
  double time_scale = 1;
  std::string emulated_clock;  // a file (timing/paced_clock.h); empty: this host's clock
  std::vector<std::string> mount_command;
  double mount_timeout_s = 120;
  ArmOptions arm;
  gateway::effector::EffectorOptions effector;
  double spacing_mm = 30;
  double max_overtravel_mm = 45;
  gateway::camera::CameraOptions camera;
  double pose_tolerance_mm = 0.5, pose_tolerance_deg = 0.1;  // of photographs: camera_pose.h
  gateway::arm::MotionLimits limits;

  GatewayOptions() { common.listen = "127.0.0.1:50061"; }
};

struct GatewayFlags {
  GatewayOptions options;
  std::string log_level = "info";
  bool log_json = false;
  bool done = false;  // help or version was printed
};

// Command line and TOML file; flags win. Paths in the file are relative to its folder. Errors name file,
// line and key.
absl::StatusOr<GatewayFlags> ParseGatewayFlags(int argc, const char* const* argv);

}  // namespace touchstone::service
