// Every check that a motion passes before it is sent, and the path that it takes. A dry run uses the same code.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/kinematics/arm_body.h"
#include "server/gateway/arm/kinematics/motion_limits.h"
#include "server/gateway/arm/motion/home_path.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/resting_face.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::gateway::arm {

struct PlannedTouch {
  ArmTouch motion;                                            // program_id is still 0
  calibration::UpFace up_face = calibration::UpFace::kPlusZ;  // that it was planned for
  std::array<double, 6> start_joints_rad{};                   // at the start, where the touch ends too
  std::array<double, 6> end_joints_rad{};                     // at the end of the stroke
  std::vector<std::string> notes;  // what is allowed but worth knowing: singularities
};

// Thread-safe after construction.
class MotionPlanner {
 public:
  // Kinematics of the individual arm, once they are known; asked whenever something is planned.
  using OwnKinematics = std::function<std::optional<DhTable>()>;

  // arm_model: a name of arm_model.h. INVALID_ARGUMENT names a limit that makes no sense. Without `own`, or while it
  // gives none, the published kinematics of the model are planned with.
  static absl::StatusOr<std::unique_ptr<MotionPlanner>> Create(const std::string& arm_model,
                                                               const MotionLimits& limits,
                                                               const calibration::Calibration& calibration,
                                                               OwnKinematics own = nullptr);
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
  // Home: out along the tool's own axis, up, across. `object_top_m`: of what lies on the fixture, base frame; none: it
  // is not known, and the tool goes up to home's height where it can.
  virtual absl::StatusOr<HomePath> PlanHome(const ArmState& from,
                                            std::optional<double> object_top_m) const = 0;
  // What is planned with: the arm's own kinematics (calibrated()) or the published ones. FAILED_PRECONDITION: the
  // controller's belong to another arm, and nothing is planned.
  virtual absl::StatusOr<UrKinematics> Kinematics() const = 0;
  // Where the arm's body is at some joints.
  virtual absl::StatusOr<BodyPoints> Body(const Joints& joints) const = 0;

  // The highest point of an object that lies so, base frame, m.
  virtual absl::StatusOr<double> ObjectTop(const std::string& object, const geometry::Bounds& bounds,
                                           calibration::UpFace up_face) const = 0;
  // base_from_object with this face up.
  virtual absl::StatusOr<Eigen::Isometry3d> ObjectPose(const std::string& object,
                                                       const geometry::Bounds& bounds,
                                                       calibration::UpFace up_face) const = 0;
  virtual const MotionLimits& limits() const = 0;
  virtual const calibration::Calibration& calibration() const = 0;
};

}  // namespace touchstone::gateway::arm
