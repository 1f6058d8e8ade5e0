#include "server/gateway/arm/motion/home_path.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "server/base/status.h"
#include "server/gateway/arm/motion/line_turn.h"
#include "server/gateway/arm/motion/transit.h"

namespace touchstone::gateway::arm {
namespace {

constexpr const char* kOutWhat = "the way out";
constexpr const char* kAcrossWhat = "the way home";

class HomeSearch {
 public:
  HomeSearch(const LineCheck& check, const MotionLimits& limits, std::optional<double> object_top_m)
      : check_(check), limits_(limits), home_(check.TipAt(limits.home_rad)) {
    const double home_m = LowestTip(home_);
    plane_m_ = object_top_m.has_value() ? *object_top_m + limits.clearance_m : home_m;
    floor_m_ = object_top_m.has_value() ? *object_top_m + limits.clearance_m / 2 : home_m - kDipM;
  }

  absl::StatusOr<HomePath> Find(const Eigen::Isometry3d& from, const Joints& here) {
    for (const std::vector<Eigen::Isometry3d>& out : WaysOut(from)) {
      HomePath path;
      path.poses = out;
      Joints above = here;
      if (!Follow(from, out, kOutWhat, &above)) continue;
      if (Across(out.empty() ? from : out.back(), above, &path)) return path;
    }
    return why_;
  }

 private:
  // Up to the plane, the usual way first: along the tool's axis, or part of the way along it and then straight up.
  std::vector<std::vector<Eigen::Isometry3d>> WaysOut(const Eigen::Isometry3d& from) const {
    std::vector<std::vector<Eigen::Isometry3d>> ways;
    const double rise_m = plane_m_ + from.translation().z() - LowestTip(from);
    const double standoff_m = limits_.max_standoff_m;
    for (const double back_m : {10.0, standoff_m, standoff_m / 2, standoff_m / 4, 0.0})
      ways.push_back(RetractPath(from, back_m, rise_m));
    return ways;
  }
  bool Keep(absl::Status status) {
    if (status.ok()) return true;
    if (why_.ok()) why_ = std::move(status);  // the first is that of the usual way
    return false;
  }
  bool Follow(Eigen::Isometry3d from, const std::vector<Eigen::Isometry3d>& poses, const char* what,
              Joints* joints) {
    int beyond = 0;
    for (const Eigen::Isometry3d& pose : poses) {
      if (!Keep(check_.Follow(from, pose, limits_.transit_speed_m_s, true, what, joints, &beyond)))
        return false;
      from = pose;
    }
    return true;
  }
  // From a pose above the plane.
  bool Across(const Eigen::Isometry3d& out, const Joints& above, HomePath* path) {
    Joints joints = above;
    const std::vector<Eigen::Isometry3d> across = SplitTurns(out, {home_});
    if (Follow(out, across, kAcrossWhat, &joints) && Turn(joints, {limits_.home_rad}, path)) {
      path->poses.insert(path->poses.end(), across.begin(), across.end());
      return true;
    }
    if (Turn(above, {limits_.home_rad}, path)) return true;
    Joints unwound = above;
    unwound[5] = limits_.home_rad[5];
    return Turn(above, {unwound, limits_.home_rad}, path);
  }
  bool Turn(Joints from, const std::vector<Joints>& through, HomePath* path) {
    for (const Joints& next : through) {
      if (!Keep(check_.FollowJoints(from, next, floor_m_, kAcrossWhat))) return false;
      from = next;
    }
    path->joints = through;
    return true;
  }
  double LowestTip(const Eigen::Isometry3d& pose) const {
    double lowest_m = pose.translation().z();
    for (const Eigen::Vector3d& tip : check_.Tips(pose)) lowest_m = std::min(lowest_m, tip.z());
    return lowest_m;
  }

  static constexpr double kDipM = 0.005;  // of a joint motion between two poses of one height
  const LineCheck& check_;
  const MotionLimits& limits_;
  const Eigen::Isometry3d home_;
  double plane_m_ = 0, floor_m_ = 0;  // that the tool is lifted to, and that no tip sinks below from there on
  absl::Status why_;
};

}  // namespace

absl::StatusOr<HomePath> FindHomePath(const LineCheck& check, const MotionLimits& limits,
                                      std::optional<double> object_top_m,
                                      const Eigen::Isometry3d& base_from_tip, const Joints& joints) {
  absl::StatusOr<HomePath> path = HomeSearch(check, limits, object_top_m).Find(base_from_tip, joints);
  if (path.ok()) return path;
  return absl::Status(
      path.status().code(),
      absl::StrCat("home: ", path.status().message(),
                   object_top_m.has_value()
                       ? ""
                       : "; how high the tool must be lifted is unknown until 'touchstone rig mount' "
                         "says what lies on the fixture",
                   "; else move the arm free by hand"));
}

}  // namespace touchstone::gateway::arm
