// An emulated UR controller on TCP: dashboard (29999), primary, secondary and realtime interface (30001 to 30003) and
// their read-only twins (30011 to 30013), RTDE (30004), a part of URScript, straight and joint motion with trapezoidal speed, safety modes and
// watchdogs. See ../../server/gateway.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "tests/rig/world.h"

namespace touchstone::rig {

struct ControllerOptions {
  std::string model = "ur3e";         // or "ur3" (CB3): kinematics, rate, dashboard texts
  std::string address = "127.0.0.1";  // listens here
  // 0: any free port, told by ports()
  int dashboard_port = 0, primary_port = 0, secondary_port = 0, realtime_port = 0, rtde_port = 0;
  int primary_read_only_port = 0, secondary_read_only_port = 0, realtime_read_only_port = 0;
  std::array<double, 6> joints_rad{{0, -1.5708, -1.5708, -1.5708, 1.5708, 0}};
  bool calibrated = false;       // a delta of its own in every row of its kinematics, as real arms have
  bool powered = false;          // begins with power off, as a controller that was just switched on
  double finger_give_m = 0.050;  // pushed further than this beyond a contact: protective stop (C153)
  double position_noise_m = 5e-6, joint_noise_rad = 2e-5;  // of what it reports
  // The arm is where its target was so long ago (README.md: the log that this is from). Contacts happen where
  // the arm is.
  double following_lag_s = 4.8e-4;
  uint64_t seed = 1;
};

class Controller {
 public:
  struct Ports {
    int dashboard = 0, primary = 0, secondary = 0, realtime = 0, rtde = 0;
    int primary_read_only = 0, secondary_read_only = 0, realtime_read_only = 0;
  };
  // Listens and runs threads until it is destroyed. Throws std::runtime_error if a port is taken.
  static std::unique_ptr<Controller> Start(const ControllerOptions& options, SimClock* clock, Faults* faults,
                                           TipListener* tip);
  virtual ~Controller() = default;
  virtual Ports ports() const = 0;
  // For the truth of tests, not for clients: base_from_tip without noise, now.
  virtual Eigen::Isometry3d BaseFromTip() const = 0;
  virtual Eigen::Isometry3d BaseFromFlange() const = 0;
  virtual bool Moving() const = 0;
  // A hand turns the joints so, at once. An error text if the arm is not free (freedrive, teach mode); else empty.
  virtual std::string MoveByHand(const std::array<double, 6>& joints_rad) = 0;
  virtual bool Free() const = 0;
  virtual bool ProgramRuns() const = 0;  // or is paused
  // How often something happened: "programs" and "motions" that began, "protective_stops", "watchdog_stops"
  // (programs that a watchdog ended or paused).
  virtual uint64_t Count(const std::string& what) const = 0;
  // What clients have sent that moves an arm or powers it, in the order in which it came: "program NAME", "power on",
  // "power off", "brake release", "unlock protective stop", whether or not it did anything. The first 10,000.
  virtual std::vector<std::string> Commands() const = 0;
};

}  // namespace touchstone::rig
