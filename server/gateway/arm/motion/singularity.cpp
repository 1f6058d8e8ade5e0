#include "server/gateway/arm/motion/singularity.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/gateway/arm/motion/line_check.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kNearRad = 10 * kRadiansPerDegree, kNearM = 0.03;
constexpr size_t kWrist3 = 5;

}  // namespace

void SingularityWatch::Keep(Nearest* nearest, double distance, const Eigen::Vector3d& tip_m,
                            const std::string& what) {
  if (distance < nearest->distance) *nearest = {distance, tip_m, what};
}

void SingularityWatch::Look(const UrKinematics& kinematics, const BodyPoints& points, const Joints& joints,
                            const Eigen::Vector3d& tip_m, const std::string& what) {
  Keep(&wrist_, std::abs(std::remainder(joints[4], kPi)), tip_m, what);
  Keep(&elbow_, std::abs(std::remainder(joints[2], 2 * kPi)), tip_m, what);
  const Eigen::Vector3d& wrist_m = points.links[kWrist3];
  const double inner_m = kinematics.model().dh[3].d_m;
  Keep(&shoulder_, std::max(0.0, std::hypot(wrist_m.x(), wrist_m.y()) - inner_m), tip_m, what);
}

std::vector<std::string> SingularityWatch::Notes() const {
  std::vector<std::string> notes;
  const auto at = [](const Nearest& nearest) {
    return absl::StrFormat("with the tip at %s m in the base frame", PointText(nearest.tip_m));
  };
  if (wrist_.distance < kNearRad)
    notes.push_back(absl::StrFormat("%s comes near the wrist singularity: wrist 2 is %.1f deg from it, %s",
                                    wrist_.what, wrist_.distance / kRadiansPerDegree, at(wrist_)));
  if (elbow_.distance < kNearRad)
    notes.push_back(
        absl::StrFormat("%s comes near the elbow singularity: the elbow is %.1f deg from stretched, %s",
                        elbow_.what, elbow_.distance / kRadiansPerDegree, at(elbow_)));
  if (shoulder_.distance < kNearM)
    notes.push_back(
        absl::StrFormat("%s comes near the shoulder singularity: wrist 3 is %.1f mm from the cylinder about "
                        "the base's axis, %s",
                        shoulder_.what, shoulder_.distance / kMetresPerMillimetre, at(shoulder_)));
  return notes;
}

}  // namespace touchstone::gateway::arm
