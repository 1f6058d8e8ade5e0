// Every check that a motion passes before it is sent, and the path that it takes. A dry run uses the same code.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/motion_limits.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/resting_face.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::gateway::arm {

struct PlannedTouch {
  ArmTouch motion;                                            // program_id is still 0
  calibration::UpFace up_face = calibration::UpFace::kPlusZ;  // that it was planned for
  std::array<double, 6> start_joints_rad{};                   // at the start, where the touch ends too
};

// Thread-safe after construction.
class MotionPlanner {
 public:
  // arm_model: "ur3" or "ur3e". INVALID_ARGUMENT names a limit that makes no sense.
  static absl::StatusOr<std::unique_ptr<MotionPlanner>> Create(const std::string& arm_model,
                                                               const MotionLimits& limits,
                                                               const calibration::Calibration& calibration);
  virtual ~MotionPlanner() = default;

  // Plans from `from` (base_from_tip and joints) to the touch. FAILED_PRECONDITION if the object must lie
  // otherwise (names the face that must point up); OUT_OF_RANGE for a pose outside the box, out of reach,
  // joints beyond their limits, too fast, with value and limit. `where` begins every message.
  virtual absl::StatusOr<PlannedTouch> Plan(const ArmState& from, const std::string& object,
                                            const geometry::Bounds& bounds, calibration::UpFace up_face,
                                            const touch::CommandedTouch& touch,
                                            const std::string& where) const = 0;
  // To a camera pose: `base_from_camera` looks along its z, y down. Same checks; motion.end is its start.
  virtual absl::StatusOr<PlannedTouch> PlanView(const ArmState& from,
                                                const Eigen::Isometry3d& base_from_camera,
                                                const std::string& object, const geometry::Bounds& bounds,
                                                calibration::UpFace up_face,
                                                const std::string& where) const = 0;
  // Home: out along the tool's own axis to the clearance height; joints then.
  virtual absl::StatusOr<std::vector<Eigen::Isometry3d>> PlanHome(const ArmState& from) const = 0;

  // base_from_object with this face up, and the touch's start (base_from_tip).
  virtual absl::StatusOr<Eigen::Isometry3d> ObjectPose(const std::string& object,
                                                       const geometry::Bounds& bounds,
                                                       calibration::UpFace up_face) const = 0;
  virtual const MotionLimits& limits() const = 0;
  virtual const calibration::Calibration& calibration() const = 0;
};

}  // namespace touchstone::gateway::arm
