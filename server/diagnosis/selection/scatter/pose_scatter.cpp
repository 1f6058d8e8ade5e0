#include "server/diagnosis/selection/scatter/pose_scatter.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <absl/strings/str_format.h>

#include "server/base/numbers/decompositions.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/scatter/rules.h"
#include "server/diagnosis/selection/session/pose_columns.h"

namespace touchstone::diagnosis::selection {
namespace {

// Of a pose, of a translation along the row of fingers and across it, of a tilt of the row, of the speed.
enum MotionColumn { kAlong = kPoseValues, kAcross, kTilt, kSpeed, kMotionColumns };

// One touch: its residuals less the mean over its pose, and what a motion changes of them.
struct Repeat {
  Eigen::VectorXd residual;  // scaled to the variance of one touch
  Eigen::MatrixXd columns;   // fingers x kMotionColumns
  double weight = 1;         // degrees of freedom per finger
};

// Changes of the fingers' times, s per m, rad and relative change of the speed, less their mean.
Eigen::MatrixXd MotionColumns(const touches::Observations& o, const touches::Prediction& d, int k) {
  Eigen::MatrixXd columns(o.fingers, static_cast<int>(kMotionColumns));
  columns.leftCols(kPoseValues) = PoseColumns(o, d, k);
  const Eigen::Vector3d& lateral = o.set->lateral[o.row[k]];
  columns.col(kAlong) = columns.leftCols(3) * lateral;
  columns.col(kAcross) = columns.leftCols(3) * o.set->approach[o.row[k]].cross(lateral);
  for (int i = 0; i < o.fingers; ++i) {
    const size_t e = static_cast<size_t>(k) * o.fingers + i;
    columns(i, kTilt) = lateral.dot(d.contact_m[e]) * d.inverse_speed_s_per_m[e];
    columns(i, kSpeed) = d.travel_m[e] * d.inverse_speed_s_per_m[e];
  }
  columns.rightCols(2).rowwise() -= columns.rightCols(2).colwise().mean().eval();
  return columns;
}

std::vector<Repeat> RepeatsOf(const touches::Observations& o, const touches::Prediction& d,
                              const std::vector<double>& residuals) {
  std::map<int, std::vector<int>> poses;
  for (int k = 0; k < o.size(); ++k)
    if (o.used[k] && HasPoseColumns(o, d, residuals, k)) poses[o.pose[k]].push_back(k);
  std::vector<Repeat> repeats;
  for (const auto& [pose, members] : poses) {
    const double count = static_cast<double>(members.size());
    if (members.size() < 2) continue;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(o.fingers);
    const auto of_touch = [&](int k) {
      return Eigen::Map<const Eigen::VectorXd>(&residuals[static_cast<size_t>(k) * o.fingers], o.fingers);
    };
    for (const int k : members) mean += of_touch(k) / count;
    for (const int k : members) {
      repeats.push_back(
          {(of_touch(k) - mean) / std::sqrt(1 - 1 / count), MotionColumns(o, d, k), 1 - 1 / count});
    }
  }
  return repeats;
}

// A direction of the residuals of one touch: its square, and the variance that a unit of motion adds to it.
struct Direction {
  double square = 0, added = 0, weight = 0;
};

std::vector<Direction> DirectionsOf(const std::vector<Repeat>& repeats, int first, int columns) {
  std::vector<Direction> directions;
  for (const Repeat& repeat : repeats) {
    const Eigen::MatrixXd own = repeat.columns.middleCols(first, columns);
    const SymmetricEigen axes = EigenOfSymmetric(own * own.transpose());
    // The mean over fingers is no direction: it is 0 in residuals and columns.
    const Eigen::Index fingers = repeat.residual.size();
    const double all = repeat.residual.squaredNorm();
    double seen = 0;
    int moved = 0;
    for (Eigen::Index j = fingers - 1; j > 0 && moved < columns; --j, ++moved) {
      const double along = axes.vectors.col(j).dot(repeat.residual);
      seen += along * along;
      directions.push_back({along * along, std::max(axes.values[j], 0.0), repeat.weight});
    }
    const double rest = static_cast<double>(fingers - 1 - moved);
    if (rest > 0) directions.push_back({std::max(all - seen, 0.0) / rest, 0, repeat.weight * rest});
  }
  return directions;
}

struct Fit {
  double gain_nats = 0, motion = 0;
};

Fit FitMotion(const std::vector<Direction>& directions) {
  double weight = 0, squares = 0, added = 0;
  for (const Direction& d : directions)
    weight += d.weight, squares += d.weight * d.square, added += d.weight * d.added;
  Fit best;
  if (!(squares > 0) || !(added > 0)) return best;
  const double unit = weight / added;  // a ratio of 1 adds as much as the noise has, on average
  for (int step = 0; step < kScatterRules.motion_ratios; ++step) {
    const double ratio = kScatterRules.smallest_ratio *
                         std::pow(kScatterRules.largest_ratio / kScatterRules.smallest_ratio,
                                  static_cast<double>(step) / (kScatterRules.motion_ratios - 1));
    double scaled = 0, logs = 0;
    for (const Direction& d : directions) {
      const double variance = 1 + ratio * unit * d.added;
      scaled += d.weight * d.square / variance;
      logs += d.weight * std::log(variance);
    }
    const double gain = 0.5 * weight * std::log(squares / scaled) - 0.5 * logs - 0.5 * std::log(weight);
    if (gain > best.gain_nats) best = {gain, std::sqrt(ratio * unit * scaled / weight)};
  }
  return best;
}

enum class MotionUnit { kMillimetres, kDegrees, kPercent };

struct Motion {
  int first, columns;
  MotionUnit unit;
  const char* words;
};
constexpr Motion kMotions[] = {{0, 1, MotionUnit::kMillimetres, "along x"},
                               {1, 1, MotionUnit::kMillimetres, "along y"},
                               {2, 1, MotionUnit::kMillimetres, "along z"},
                               {0, 3, MotionUnit::kMillimetres, "in any direction"},
                               {3, 1, MotionUnit::kDegrees, "about x"},
                               {4, 1, MotionUnit::kDegrees, "about y"},
                               {5, 1, MotionUnit::kDegrees, "about z"},
                               {kAlong, 1, MotionUnit::kMillimetres, "along the row of fingers"},
                               {kAcross, 1, MotionUnit::kMillimetres, "across the row of fingers"},
                               {kTilt, 1, MotionUnit::kDegrees, "tilted against the approach"},
                               {kSpeed, 1, MotionUnit::kPercent, ""}};

std::string MotionInWords(const Motion& motion, double size, bool ahead) {
  const char* noise = ahead ? "less well" : "about as well";
  if (motion.unit == MotionUnit::kPercent)
    return absl::StrFormat(
        "Repeats scatter as if the arm had another speed at every touch, by about %.2g %% (standard "
        "deviation): "
        "an arm that does not keep its speed, or a clock that does not. Noise of the fingers explains that "
        "%s. "
        "Record the arm's speed during an approach, and touch at another speed.",
        size * 100, noise);
  const bool turns = motion.unit == MotionUnit::kDegrees;
  return absl::StrFormat(
      "Repeats scatter as if the object or the tool lay elsewhere at every touch, by about %.2g %s %s "
      "(standard "
      "deviation): play of the arm, or a loose mount. Noise of the fingers explains that %s. Hold a gauge to "
      "the "
      "tool and to the object, and touch from one side only.",
      size * (turns ? 1 / kRadiansPerDegree : kMillimetresPerMetre), turns ? "deg" : "mm", motion.words,
      noise);
}

}  // namespace

std::optional<PoseScatter> FindPoseScatter(const touches::Observations& o, const touches::Prediction& d,
                                           const std::vector<double>& residuals,
                                           const touches::NoiseFindings& noise) {
  if (o.fingers < 2 || d.contact_m.size() != residuals.size() || d.travel_m.size() != residuals.size() ||
      d.normal.size() != residuals.size())
    return std::nullopt;
  const std::vector<Repeat> repeats = RepeatsOf(o, d, residuals);
  double degrees = 0;
  for (const Repeat& repeat : repeats) degrees += repeat.weight * (o.fingers - 1);
  if (degrees < kScatterRules.min_motion_dof) return std::nullopt;
  Fit best;
  const Motion* motion = nullptr;
  for (const Motion& tried : kMotions) {
    const Fit fit = FitMotion(DirectionsOf(repeats, tried.first, tried.columns));
    if (fit.gain_nats > best.gain_nats) best = fit, motion = &tried;
  }
  double noise_nats =
      noise.slope.gain_nats + noise.degrees_of_freedom.gain_nats + noise.length_sigma_m.gain_nats;
  if (!noise.channel_sigma_s.empty()) noise_nats += noise.channel_sigma_s[0].gain_nats;
  if (motion == nullptr ||
      best.gain_nats < std::max(kScatterRules.motion.value(), noise_nats - kScatterRules.ahead_of_noise))
    return std::nullopt;
  PoseScatter found{best.motion, best.gain_nats, best.gain_nats > noise_nats + kScatterRules.ahead_of_noise,
                    ""};
  found.words = MotionInWords(*motion, best.motion, found.ahead);
  return found;
}

}  // namespace touchstone::diagnosis::selection
