#include "server/diagnosis/touches/same_poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "server/base/numbers/distributions.h"

namespace touchstone::diagnosis::touches {
namespace {

constexpr int kCommandNumbers = 11;
using Command = std::pair<std::string, std::array<double, kCommandNumbers>>;

struct MeanAtPose {
  std::vector<double> sum_s;  // by finger
  int touches = 0;
};

Command CommandOf(const Observations& o, int k) {
  const session::MeasurementSet& set = *o.set;
  const int row = o.row[k];
  Command command{o.objects[o.object[k]], {}};
  for (int axis = 0; axis < 3; ++axis) {
    command.second[axis] = set.target_m[row][axis];
    command.second[3 + axis] = set.approach[row][axis];
    command.second[6 + axis] = set.lateral[row][axis];
  }
  command.second[9] = set.standoff_m[row];
  command.second[10] = set.speed_m_s[row];
  return command;
}

std::map<Command, MeanAtPose> MeansByPose(const PosedResiduals& of) {
  const Observations& o = *of.observations;
  std::map<Command, MeanAtPose> means;
  for (int k = 0; k < o.size(); ++k) {
    const double* residuals = &(*of.residuals_s)[static_cast<size_t>(k) * o.fingers];
    if (!o.used[k] ||
        std::any_of(residuals, residuals + o.fingers, [](double value) { return std::isnan(value); }))
      continue;
    MeanAtPose& mean = means[CommandOf(o, k)];
    mean.sum_s.resize(o.fingers, 0.0);
    for (int i = 0; i < o.fingers; ++i) mean.sum_s[i] += residuals[i];
    ++mean.touches;
  }
  return means;
}

}  // namespace

SamePoses CompareSamePoses(const PosedResiduals& one, const PosedResiduals& other) {
  SamePoses same;
  const int fingers = one.observations->fingers;
  if (fingers != other.observations->fingers || fingers < 2) return same;
  const std::map<Command, MeanAtPose> first = MeansByPose(one), second = MeansByPose(other);
  double squares = 0, scaled = 0, expected = 0;
  for (const auto& [command, a] : first) {
    const auto found = second.find(command);
    if (found == second.end()) continue;
    const MeanAtPose& b = found->second;
    const double variance = one.sigma_s * one.sigma_s / a.touches + other.sigma_s * other.sigma_s / b.touches;
    double sum = 0;
    for (int i = 0; i < fingers; ++i) sum += std::pow(b.sum_s[i] / b.touches - a.sum_s[i] / a.touches, 2);
    squares += sum, scaled += sum / variance, expected += variance;
    ++same.poses;
  }
  if (same.poses == 0) return same;
  // Differences between fingers: a touch's mean takes one degree of freedom.
  const double degrees = static_cast<double>(same.poses) * (fingers - 1);
  same.rms_s = std::sqrt(squares / degrees);
  same.expected_s = std::sqrt(expected / same.poses);
  same.p = FisherTail(scaled / degrees, degrees, std::min(one.degrees_of_freedom, other.degrees_of_freedom));
  return same;
}

}  // namespace touchstone::diagnosis::touches
