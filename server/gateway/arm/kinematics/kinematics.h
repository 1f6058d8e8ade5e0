// Where the flange of a UR arm is for given joints, and which joints take it to a given place.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics/arm_model.h"

namespace touchstone::gateway::arm {

using Joints = std::array<double, 6>;  // rad, base to wrist 3

// The largest difference of a joint, rad.
double Farthest(const Joints& a, const Joints& b);

class UrKinematics {
 public:
  // A model by its name (arm_model.h), as the maker publishes it.
  static absl::StatusOr<UrKinematics> ForModel(const std::string& model);
  // The same arm as it was calibrated at the factory. FAILED_PRECONDITION if the table leads the flange more than 50 mm
  // from where the model's does, or fits another model better: it belongs to another arm.
  absl::StatusOr<UrKinematics> Calibrated(const DhTable& table) const;

  Eigen::Isometry3d Forward(const Joints& joints) const;  // base_from_flange

  // All joints (at most eight) that reach the pose, each turned by whole turns to be nearest to `near`;
  // nearest first. Empty: out of reach. Where wrist 2 makes joints 4 and 6 one, wrist 3 stays as in `near`.
  std::vector<Joints> Inverse(const Eigen::Isometry3d& base_from_flange, const Joints& near) const;
  // The first of them, without the work for the others.
  std::optional<Joints> Nearest(const Eigen::Isometry3d& base_from_flange, const Joints& near) const;

  // Origins of the joints' frames: base, shoulder, elbow, wrist 1, wrist 2, wrist 3, flange. By the published table
  // even of a calibrated arm, to some millimetres: the joints 2 to 4 are parallel, and a calibration may put their
  // frames anywhere along their axes, far outside the arm.
  std::array<Eigen::Vector3d, 7> LinkPoints(const Joints& joints) const;

  const DhTable& table() const { return table_; }
  const ArmModel& model() const { return *model_; }
  bool calibrated() const { return calibrated_; }

 private:
  explicit UrKinematics(const ArmModel* model) : model_(model), nominal_(model->dh), table_(model->dh) {}
  // As Inverse, of the published table, refined or not.
  std::vector<Joints> NominalInverse(const Eigen::Isometry3d& base_from_flange, const Joints& near) const;
  // Refines joints of the nominal table for the calibrated one; false if it does not converge.
  bool Refine(const Eigen::Isometry3d& base_from_flange, Joints* joints) const;

  const ArmModel* model_;
  DhTable nominal_, table_;
  bool calibrated_ = false;
};

}  // namespace touchstone::gateway::arm
