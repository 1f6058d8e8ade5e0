// Where the flange of a UR arm is for given joints, and which joints take it to a given place.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

namespace touchstone::gateway::arm {

using Joints = std::array<double, 6>;  // rad, base to wrist 3

// Denavit-Hartenberg: frame i+1 = Rz(joint + theta) Tz(d) Tx(a) Rx(alpha). m, rad.
struct DhRow {
  double a_m = 0, d_m = 0, alpha_rad = 0, theta_rad = 0;
};
using DhTable = std::array<DhRow, 6>;

// The largest difference of a joint, rad.
double Farthest(const Joints& a, const Joints& b);

class UrKinematics {
 public:
  // "ur3" or "ur3e", as the maker publishes them.
  static absl::StatusOr<UrKinematics> ForModel(const std::string& model);
  // The same arm as it was calibrated at the factory. FAILED_PRECONDITION if the table leads the flange more
  // than 50 mm from where the model's does: it belongs to another arm.
  absl::StatusOr<UrKinematics> Calibrated(const DhTable& table) const;

  Eigen::Isometry3d Forward(const Joints& joints) const;  // base_from_flange

  // All joints (at most eight) that reach the pose, each turned by whole turns to be nearest to `near`;
  // nearest first. Empty: out of reach. Where wrist 2 makes joints 4 and 6 one, wrist 3 stays as in `near`.
  std::vector<Joints> Inverse(const Eigen::Isometry3d& base_from_flange, const Joints& near) const;

  const DhTable& table() const { return table_; }

 private:
  // Refines joints of the nominal table for the calibrated one; false if it does not converge.
  bool Refine(const Eigen::Isometry3d& base_from_flange, Joints* joints) const;

  DhTable nominal_, table_;
  bool calibrated_ = false;
};

}  // namespace touchstone::gateway::arm
