#include "server/gateway/arm/motion/line_turn.h"

#include <absl/strings/str_format.h>

#include <cmath>

#include "server/base/units.h"
#include "server/gateway/arm/motion/cartesian_speed.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kTurnToleranceRad = 1e-6;

}  // namespace

double TurnRad(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  return Eigen::AngleAxisd(from.linear().transpose() * to.linear()).angle();
}

std::vector<Eigen::Isometry3d> SplitTurns(Eigen::Isometry3d from,
                                          const std::vector<Eigen::Isometry3d>& poses) {
  std::vector<Eigen::Isometry3d> split;
  for (const Eigen::Isometry3d& pose : poses) {
    const int parts =
        static_cast<int>(std::ceil((TurnRad(from, pose) - kTurnToleranceRad) / kMaxLineTurnRad));
    for (int part = 1; part < parts; ++part)
      split.push_back(PoseBetween(from, pose, static_cast<double>(part) / parts));
    split.push_back(pose);
    from = pose;
  }
  return split;
}

absl::Status CheckLineTurn(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to,
                           const std::string& what) {
  const double turn_rad = TurnRad(from, to);
  if (turn_rad <= kMaxLineTurnRad + 2 * kTurnToleranceRad) return absl::OkStatus();
  return absl::OutOfRangeError(absl::StrFormat(
      "%s turns the tool by %.1f deg on one line; at most %.0f deg, so that it is certain which way round",
      what, turn_rad / kRadiansPerDegree, kMaxLineTurnRad / kRadiansPerDegree));
}

}  // namespace touchstone::gateway::arm
