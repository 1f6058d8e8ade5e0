#include "server/gateway/arm/motion/motion_planner.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/gateway/arm/motion/line_check.h"
#include "server/gateway/arm/motion/transit.h"
#include "server/gateway/arm/motion/ur_script.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kSettleS = 0.05;         // of the arm at the end of a line, and of the program's start
constexpr double kWristReserveRad = 0.2;  // that a transit leaves of wrist 3's range, where it can
constexpr double kMinStandoffM = 1e-3;

class UrMotionPlanner final : public MotionPlanner {
 public:
  UrMotionPlanner(const UrKinematics& published, const MotionLimits& limits,
                  const calibration::Calibration& calibration, OwnKinematics own)
      : published_(published), limits_(limits), calibration_(calibration), own_(std::move(own)) {}

  absl::StatusOr<PlannedTouch> Plan(const ArmState& from, const std::string& object,
                                    const geometry::Bounds& bounds, calibration::UpFace up_face,
                                    const touch::CommandedTouch& touch,
                                    const std::string& where) const override;
  absl::StatusOr<PlannedTouch> PlanView(const ArmState& from, const Eigen::Isometry3d& base_from_camera,
                                        const std::string& object, const geometry::Bounds& bounds,
                                        calibration::UpFace up_face, const std::string& where) const override;
  absl::StatusOr<HomePath> PlanHome(const ArmState& from, std::optional<double> object_top_m) const override;
  absl::StatusOr<double> ObjectTop(const std::string& object, const geometry::Bounds& bounds,
                                   calibration::UpFace up_face) const override {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Isometry3d base_from_object,
                                ObjectPose(object, bounds, up_face));
    return ClearanceHeight(base_from_object, bounds) - limits_.clearance_m;
  }
  absl::StatusOr<UrKinematics> Kinematics() const override {
    const std::optional<DhTable> own = own_ ? own_() : std::nullopt;
    if (!own.has_value()) return published_;
    return published_.Calibrated(*own);
  }
  absl::StatusOr<BodyPoints> Body(const Joints& joints) const override {
    TOUCHSTONE_ASSIGN_OR_RETURN(const LineCheck check, Check());
    return check.body().At(check.kinematics(), joints);
  }
  absl::StatusOr<Eigen::Isometry3d> ObjectPose(const std::string& object, const geometry::Bounds& bounds,
                                               calibration::UpFace up_face) const override;
  const MotionLimits& limits() const override { return limits_; }
  const calibration::Calibration& calibration() const override { return calibration_; }

 private:
  absl::Status CheckTouch(const std::string& object, calibration::UpFace up_face,
                          const touch::CommandedTouch& touch) const;
  // The height of the clearance plane over an object, base frame.
  double ClearanceHeight(const Eigen::Isometry3d& base_from_object, const geometry::Bounds& bounds) const;
  absl::StatusOr<LineCheck> Check() const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const UrKinematics kinematics, Kinematics());
    return LineCheck(kinematics, limits_, calibration_);
  }
  // Joints where the arm is, as the planner's own kinematics has them.
  static absl::StatusOr<Joints> JointsOf(const LineCheck& check, const ArmState& from);
  // Follows all lines; the joints at the end.
  absl::StatusOr<Joints> FollowAll(const LineCheck& check, Eigen::Isometry3d from,
                                   const std::vector<Eigen::Isometry3d>& poses, Joints joints,
                                   int* wrist_3_beyond, SingularityWatch* watch) const;
  // A checked path from where the arm is to a pose, over the clearance plane; *joints become those of its end.
  absl::StatusOr<std::vector<Eigen::Isometry3d>> Transit(const LineCheck& check, const ArmState& from,
                                                         const Eigen::Isometry3d& start,
                                                         double clearance_height_m, Joints* joints,
                                                         SingularityWatch* watch) const;
  double TransitDuration(Eigen::Isometry3d from, const std::vector<Eigen::Isometry3d>& poses) const;

  const UrKinematics published_;
  const MotionLimits limits_;
  const calibration::Calibration calibration_;
  const OwnKinematics own_;
};

absl::Status UrMotionPlanner::CheckTouch(const std::string& object, calibration::UpFace up_face,
                                         const touch::CommandedTouch& touch) const {
  if (!touch.target_m.allFinite() || !touch.approach.allFinite() || !touch.lateral.allFinite() ||
      !std::isfinite(touch.stroke_m))
    return absl::InvalidArgumentError("target, approach, lateral and stroke must be finite numbers");
  const auto mm = [](double metres) { return FileNumber(Unit::kMillimetre, metres); };
  if (!(touch.speed_m_s >= limits_.min_speed_m_s) || touch.speed_m_s > limits_.max_speed_m_s)
    return absl::OutOfRangeError(
        absl::StrCat("speed ", FileNumber(Unit::kMillimetrePerSecond, touch.speed_m_s),
                     " mm/s: must be from ", FileNumber(Unit::kMillimetrePerSecond, limits_.min_speed_m_s),
                     " to ", FileNumber(Unit::kMillimetrePerSecond, limits_.max_speed_m_s), " mm/s"));
  if (!(touch.standoff_m >= kMinStandoffM) || touch.standoff_m > limits_.max_standoff_m)
    return absl::OutOfRangeError(absl::StrCat("standoff ", mm(touch.standoff_m), " mm: must be from ",
                                              mm(kMinStandoffM), " to ", mm(limits_.max_standoff_m), " mm"));
  if (!(touch.stroke_m > 0))
    return absl::OutOfRangeError(absl::StrCat("stroke ", mm(touch.stroke_m), " mm: must be above 0"));
  const calibration::UpFace needed = calibration::UpFaceFor(touch.approach);
  if (up_face != needed)
    return absl::FailedPreconditionError(
        absl::StrCat("object '", object, "' must lie with its face ", calibration::UpFaceName(needed),
                     " up for an approach along ", PointText(touch.approach), "; it lies with ",
                     calibration::UpFaceName(up_face), " up"));
  return absl::OkStatus();
}

absl::StatusOr<Eigen::Isometry3d> UrMotionPlanner::ObjectPose(const std::string& object,
                                                              const geometry::Bounds& bounds,
                                                              calibration::UpFace up_face) const {
  const auto found = calibration_.base_from_object.find(object);
  if (found == calibration_.base_from_object.end()) {
    std::vector<std::string> known;
    for (const auto& [name, pose] : calibration_.base_from_object) known.push_back(name);
    return absl::FailedPreconditionError(absl::StrCat("the calibration has no base_from_object of '", object,
                                                      "'", DidYouMean(object, known),
                                                      "; 'touchstone rig calibrate' finds it"));
  }
  return calibration::BaseFromObject(found->second, bounds, up_face);
}

double UrMotionPlanner::ClearanceHeight(const Eigen::Isometry3d& base_from_object,
                                        const geometry::Bounds& bounds) const {
  double top_m = -1e300;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d at(corner & 1 ? bounds.min_m.x() : bounds.max_m.x(),
                             corner & 2 ? bounds.min_m.y() : bounds.max_m.y(),
                             corner & 4 ? bounds.min_m.z() : bounds.max_m.z());
    top_m = std::max(top_m, (base_from_object * at).z());
  }
  return top_m + limits_.clearance_m;
}

absl::StatusOr<Joints> UrMotionPlanner::JointsOf(const LineCheck& check, const ArmState& from) {
  // Calibrated kinematics differ from the published ones by millimetres: joints a few degrees apart
  // are another arm.
  constexpr double kOtherArmRad = 0.15;
  Joints joints;
  if (!from.base_from_tip.matrix().allFinite() ||
      !check.JointsAt(from.base_from_tip, from.joints_rad, &joints) ||
      Farthest(joints, from.joints_rad) > kOtherArmRad)
    return absl::FailedPreconditionError(
        absl::StrCat("the arm's present pose at ", PointText(from.base_from_tip.translation()),
                     " m does not fit its joints: are the arm's model and flange_from_tip right? Or the "
                     "wrist is stretched; move the "
                     "arm home by hand"));
  return joints;
}

absl::StatusOr<Joints> UrMotionPlanner::FollowAll(const LineCheck& check, Eigen::Isometry3d from,
                                                  const std::vector<Eigen::Isometry3d>& poses, Joints joints,
                                                  int* wrist_3_beyond, SingularityWatch* watch) const {
  *wrist_3_beyond = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    const std::string what = i + 1 == poses.size() ? "the descent to the start" : "the transit";
    TOUCHSTONE_RETURN_IF_ERROR(
        check.Follow(from, poses[i], limits_.transit_speed_m_s, true, what, &joints, wrist_3_beyond, watch));
    from = poses[i];
  }
  return joints;
}

absl::StatusOr<std::vector<Eigen::Isometry3d>> UrMotionPlanner::Transit(
    const LineCheck& check, const ArmState& from, const Eigen::Isometry3d& start, double clearance_height_m,
    Joints* joints, SingularityWatch* watch) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Joints here, JointsOf(check, from));
  const TransitPath path{from.base_from_tip, start, clearance_height_m, limits_.outermost_finger_m};
  std::vector<Eigen::Isometry3d> poses = path.Poses(0);
  int beyond = 0;
  SingularityWatch seen;
  absl::StatusOr<Joints> end = FollowAll(check, from.base_from_tip, poses, here, &beyond, &seen);
  // Near its limit it would be stuck: the approach and the next retract turn it a little, too.
  if (end.ok() && (*end)[5] > limits_.joint_max_rad[5] - kWristReserveRad) beyond = 1;
  if (end.ok() && (*end)[5] < limits_.joint_min_rad[5] + kWristReserveRad) beyond = -1;
  // The tool turns in the other direction where wrist 3 would wind the cable up, and, whichever that is, where the arm
  // cannot follow.
  std::vector<int> others;
  if (beyond != 0)
    others = {-beyond};
  else if (!end.ok())
    others = {1, -1};
  for (const int turn : others) {
    const std::vector<Eigen::Isometry3d> turned = path.Poses(turn);
    SingularityWatch seen_then;
    absl::StatusOr<Joints> other = FollowAll(check, from.base_from_tip, turned, here, &beyond, &seen_then);
    if (!other.ok()) continue;
    poses = turned, end = other, seen = seen_then;
    break;
  }
  TOUCHSTONE_RETURN_IF_ERROR(end.status());
  *watch = seen;
  *joints = *end;
  return poses;
}

double UrMotionPlanner::TransitDuration(Eigen::Isometry3d from,
                                        const std::vector<Eigen::Isometry3d>& poses) const {
  double duration_s = kSettleS;
  for (const Eigen::Isometry3d& pose : poses) {
    duration_s += LineDuration(from, pose, limits_.transit_speed_m_s, limits_.acceleration_m_s2);
    from = pose;
  }
  return duration_s;
}

absl::StatusOr<PlannedTouch> UrMotionPlanner::Plan(const ArmState& from, const std::string& object,
                                                   const geometry::Bounds& bounds,
                                                   calibration::UpFace up_face,
                                                   const touch::CommandedTouch& touch,
                                                   const std::string& where) const {
  const auto plan = [&]() -> absl::StatusOr<PlannedTouch> {
    TOUCHSTONE_RETURN_IF_ERROR(CheckTouch(object, up_face, touch));
    TOUCHSTONE_ASSIGN_OR_RETURN(const LineCheck check, Check());
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Isometry3d base_from_object,
                                ObjectPose(object, bounds, up_face));

    // The tip's frame: z along the approach, x along the fingers.
    Eigen::Isometry3d object_from_start = Eigen::Isometry3d::Identity();
    const Eigen::Vector3d z = touch.approach.normalized();
    const Eigen::Vector3d x = (touch.lateral - touch.lateral.dot(z) * z).normalized();
    if (!x.allFinite() || !z.allFinite())
      return absl::InvalidArgumentError("approach and lateral must not be parallel or zero");
    object_from_start.linear() << x, z.cross(x), z;
    object_from_start.translation() = touch.target_m - touch.standoff_m * z;
    const Eigen::Isometry3d start = base_from_object * object_from_start;
    const double tilt_rad = std::acos(std::clamp(-start.linear()(2, 2), -1.0, 1.0));
    if (tilt_rad > limits_.max_tilt_rad + 1e-9)
      return absl::OutOfRangeError(
          absl::StrFormat("the approach is tilted %.1f deg from straight down; at most %.1f deg",
                          tilt_rad / kRadiansPerDegree, limits_.max_tilt_rad / kRadiansPerDegree));
    const double stroke_m = touch.stroke_m < touch::kNoStrokeLimitM
                                ? touch.stroke_m
                                : touch.standoff_m + limits_.stroke_beyond_target_m;

    PlannedTouch planned;
    planned.up_face = up_face;
    planned.motion.speed_m_s = touch.speed_m_s;
    planned.motion.end = start * Eigen::Translation3d(0, 0, stroke_m);
    Joints joints;
    SingularityWatch watch;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        planned.motion.transit,
        Transit(check, from, start, ClearanceHeight(base_from_object, bounds), &joints, &watch));
    planned.start_joints_rad = joints;
    int beyond = 0;
    TOUCHSTONE_RETURN_IF_ERROR(check.Follow(start, planned.motion.end, touch.speed_m_s, false, "the approach",
                                            &joints, &beyond, &watch));
    planned.end_joints_rad = joints;
    planned.notes = watch.Notes();

    // Contacts are expected at the target.
    const Eigen::Isometry3d target = start * Eigen::Translation3d(0, 0, std::min(stroke_m, touch.standoff_m));
    planned.motion.duration_s = TransitDuration(from.base_from_tip, planned.motion.transit) +
                                LineDuration(start, target, touch.speed_m_s, limits_.acceleration_m_s2) +
                                TransitDuration(target, {start});
    return planned;
  }();
  if (plan.ok()) return plan;
  return absl::Status(plan.status().code(), absl::StrCat(where, ": ", plan.status().message()));
}

absl::StatusOr<PlannedTouch> UrMotionPlanner::PlanView(
    const ArmState& from, const Eigen::Isometry3d& base_from_camera, const std::string& object,
    const geometry::Bounds& bounds, calibration::UpFace up_face, const std::string& where) const {
  const auto plan = [&]() -> absl::StatusOr<PlannedTouch> {
    if (!calibration_.has_camera)
      return absl::FailedPreconditionError("the calibration has no flange_from_camera");
    if (!base_from_camera.matrix().allFinite())
      return absl::InvalidArgumentError("the camera's pose must be finite numbers");
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Isometry3d base_from_object,
                                ObjectPose(object, bounds, up_face));
    const Eigen::Isometry3d tip =
        base_from_camera * calibration_.flange_from_camera.inverse() * calibration_.flange_from_tip;
    PlannedTouch planned;
    planned.up_face = up_face;
    planned.motion.speed_m_s = limits_.transit_speed_m_s;
    planned.motion.end = tip;
    Joints joints;
    SingularityWatch watch;
    TOUCHSTONE_ASSIGN_OR_RETURN(const LineCheck check, Check());
    TOUCHSTONE_ASSIGN_OR_RETURN(
        planned.motion.transit,
        Transit(check, from, tip, ClearanceHeight(base_from_object, bounds), &joints, &watch));
    planned.start_joints_rad = planned.end_joints_rad = joints;
    planned.notes = watch.Notes();
    planned.motion.duration_s = TransitDuration(from.base_from_tip, planned.motion.transit);
    return planned;
  }();
  if (plan.ok()) return plan;
  return absl::Status(plan.status().code(), absl::StrCat(where, ": ", plan.status().message()));
}

absl::StatusOr<HomePath> UrMotionPlanner::PlanHome(const ArmState& from,
                                                   std::optional<double> object_top_m) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const LineCheck check, Check());
  TOUCHSTONE_ASSIGN_OR_RETURN(const Joints here, JointsOf(check, from));
  return FindHomePath(check, limits_, object_top_m, from.base_from_tip, here);
}

}  // namespace

absl::StatusOr<std::unique_ptr<MotionPlanner>> MotionPlanner::Create(
    const std::string& arm_model, const MotionLimits& limits, const calibration::Calibration& calibration,
    OwnKinematics own) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const UrKinematics published, UrKinematics::ForModel(arm_model));
  TOUCHSTONE_RETURN_IF_ERROR(CheckMotionLimits(limits, published.model()));
  return std::unique_ptr<MotionPlanner>(
      std::make_unique<UrMotionPlanner>(published, limits, calibration, std::move(own)));
}

}  // namespace touchstone::gateway::arm
