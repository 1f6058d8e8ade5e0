// Every check that a motion passes before it is sent, and the path that it takes. A dry run uses the same code.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/arm.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/resting_face.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::gateway::arm {

// What a rig permits; each is a key of the gateway's configuration.
struct MotionLimits {
  double max_speed_m_s = 0.1;  // of an approach
  double transit_speed_m_s = 0.15;
  double acceleration_m_s2 = 1.2;  // of approaches and transits
  double max_standoff_m = 0.15;
  double stroke_beyond_target_m =
      0.03;                      // an approach without a stroke of its own ends so far behind its target
  double max_tilt_rad = 1.0472;  // of an approach from straight down, base frame
  double clearance_m = 0.05;     // transits cross so far above the object's box and every start
  // The box, base frame, that the tip must stay in, and the joints that the arm must stay between.
  Eigen::Vector3d box_min_m{-0.5, -0.5, 0.0}, box_max_m{0.5, 0.5, 0.7};
  std::array<double, 6> joint_min_rad{{-6.2832, -6.2832, -6.2832, -6.2832, -6.2832, -6.2832}};
  std::array<double, 6> joint_max_rad{{6.2832, 6.2832, 6.2832, 6.2832, 6.2832, 6.2832}};
  double payload_kg = 0.5, max_payload_kg = 3.0;
  double outermost_finger_m =
      0.03;  // tip of the outermost finger from the middle one's, along x of the tip frame
  // The tool looks down, high above what lies on the fixture: the arm crosses to it at its tip's height.
  std::array<double, 6> home_rad{{0, -1.5708, -0.9599, -2.1817, 1.5708, 0}};
};

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
