// What Universal Robots publishes of the arms that a rig can have: one row per arm. Nothing else in the gateway depends
// on a model's name.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

namespace touchstone::gateway::arm {

// Denavit-Hartenberg: frame i+1 = Rz(joint + theta) Tz(d) Tx(a) Rx(alpha). m, rad.
struct DhRow {
  double a_m = 0, d_m = 0, alpha_rad = 0, theta_rad = 0;
};
using DhTable = std::array<DhRow, 6>;

struct ArmModel {
  const char* name;  // "ur3e", as the configuration writes it
  bool e_series;     // else CB3, which knows neither remote control nor freedrive_mode
  DhTable dh;        // before the calibration of the individual arm
  std::array<double, 6>
      max_joint_rad;  // either way; wrist 3 of the UR3s turns without end, but its cables do not
  std::array<double, 6> max_joint_speed_rad_s;
  double max_payload_kg;
  double reach_m;           // of the wrist from the shoulder, as the data sheets say it
  double rtde_hz;           // states per second
  double force_accuracy_n;  // of the force on the tip
  double force_range_n;     // beyond which no force is measured
};

const std::vector<ArmModel>& ArmModels();
// INVALID_ARGUMENT lists the known names.
absl::StatusOr<const ArmModel*> FindArmModel(const std::string& name);
// "ur3, ur3e, ur5e or ur10e"
std::string ArmModelNames();

}  // namespace touchstone::gateway::arm
