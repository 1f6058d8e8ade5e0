#include "server/diagnosis/selection/pose_scatter.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <absl/strings/str_format.h>

#include "server/base/decompositions.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/pose_columns.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kMinGainNats = 10;
constexpr double kAheadOfNoiseNats = 4;
constexpr double kMinScatterDegrees = 60;
constexpr int kRatios = 48;  // of the two scatters' squares that are tried
constexpr double kSmallestRatio = 0.01, kLargestRatio = 100;

// One touch: its residuals less the mean over its pose, and what a motion changes of them.
struct Repeat {
  Eigen::VectorXd residual;  // scaled to the variance of one touch
  Eigen::MatrixXd columns;   // fingers x (kPoseValues + 2): and along the row of fingers, and across it
  double weight = 1;         // degrees of freedom per finger
};

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
      const Eigen::MatrixXd pose_columns = PoseColumns(o, d, k);
      const Eigen::Vector3d& lateral = o.set->lateral[o.row[k]];
      Repeat repeat{(of_touch(k) - mean) / std::sqrt(1 - 1 / count),
                    Eigen::MatrixXd(o.fingers, kPoseValues + 2), 1 - 1 / count};
      repeat.columns << pose_columns, pose_columns.leftCols(3) * lateral,
          pose_columns.leftCols(3) * o.set->approach[o.row[k]].cross(lateral);
      repeats.push_back(std::move(repeat));
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
  for (int step = 0; step < kRatios; ++step) {
    const double ratio =
        kSmallestRatio * std::pow(kLargestRatio / kSmallestRatio, static_cast<double>(step) / (kRatios - 1));
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

struct Motion {
  int first, columns;
  const char* words;
};
constexpr Motion kMotions[] = {{0, 1, "along x"},
                               {1, 1, "along y"},
                               {2, 1, "along z"},
                               {0, 3, "in any direction"},
                               {3, 1, "about x"},
                               {4, 1, "about y"},
                               {5, 1, "about z"},
                               {kPoseValues, 1, "along the row of fingers"},
                               {kPoseValues + 1, 1, "across the row of fingers"}};

bool IsRotation(const Motion& motion) {
  return motion.first >= 3 && motion.first < kPoseValues;
}

}  // namespace

std::optional<PoseScatter> FindPoseScatter(const touches::Observations& o, const touches::Prediction& d,
                                           const std::vector<double>& residuals,
                                           const touches::NoiseFindings& noise) {
  if (o.fingers < 2 || d.contact_m.size() != residuals.size() || d.normal.size() != residuals.size())
    return std::nullopt;
  const std::vector<Repeat> repeats = RepeatsOf(o, d, residuals);
  double degrees = 0;
  for (const Repeat& repeat : repeats) degrees += repeat.weight * (o.fingers - 1);
  if (degrees < kMinScatterDegrees) return std::nullopt;
  Fit best;
  const Motion* motion = nullptr;
  for (const Motion& tried : kMotions) {
    const Fit fit = FitMotion(DirectionsOf(repeats, tried.first, tried.columns));
    if (fit.gain_nats > best.gain_nats) best = fit, motion = &tried;
  }
  double noise_nats =
      noise.slope.gain_nats + noise.degrees_of_freedom.gain_nats + noise.length_sigma_m.gain_nats;
  if (!noise.channel_sigma_s.empty()) noise_nats += noise.channel_sigma_s[0].gain_nats;
  if (motion == nullptr || best.gain_nats < std::max(kMinGainNats, noise_nats - kAheadOfNoiseNats))
    return std::nullopt;
  const bool turns = IsRotation(*motion);
  PoseScatter found{best.motion, best.gain_nats, best.gain_nats > noise_nats + kAheadOfNoiseNats, ""};
  found.words = absl::StrFormat(
      "Repeats scatter as if the object or the tool lay elsewhere at every touch, by about %.2g %s %s "
      "(standard "
      "deviation): play of the arm, or a loose mount. Noise of the fingers explains that %s. Hold a gauge to "
      "the "
      "tool and to the object, and touch from one side only.",
      best.motion * (turns ? 1 / kRadiansPerDegree : kMillimetresPerMetre), turns ? "deg" : "mm",
      motion->words, found.ahead ? "less well" : "about as well");
  return found;
}

}  // namespace touchstone::diagnosis::selection
