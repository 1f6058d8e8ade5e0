#include "server/diagnosis/checks/rows/round_speed.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/checks/rows/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

// The contrasts of one touch with all its fingers, by its round.
using RoundsOfPose = std::map<int, Eigen::VectorXd>;

struct Slope {
  double value = 0, error = 0;
  double scatter_s2 = 0;  // mean square of what the factor leaves, less what the others' mean adds
  double degrees = 0;
};

// How much longer the times of `round` are than the mean of those of `others`, relative.
std::optional<Slope> SlopeOf(const std::vector<RoundsOfPose>& poses, int round,
                             const std::vector<int>& others) {
  double xx = 0, xd = 0, dd = 0, count = 0;
  struct Pair {
    double xx, xd;  // weighed
  };
  std::vector<Pair> pairs;
  for (const RoundsOfPose& pose : poses) {
    const auto own = pose.find(round);
    if (own == pose.end()) continue;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(own->second.size());
    double n = 0;
    for (const int other : others)
      if (const auto found = pose.find(other); found != pose.end()) mean += found->second, n += 1;
    if (n == 0) continue;
    mean /= n;
    // Of a difference whose variance is (1 + 1/n) times that of one touch.
    const double weight = 1 / (1 + 1 / n);
    const Eigen::VectorXd apart = own->second - mean;
    pairs.push_back({weight * mean.squaredNorm(), weight * mean.dot(apart)});
    xx += pairs.back().xx, xd += pairs.back().xd;
    dd += weight * apart.squaredNorm();
    count += static_cast<double>(mean.size());
  }
  if (static_cast<int>(pairs.size()) < kRowCheckRules.min_pairs || !(xx > 0)) return std::nullopt;
  Slope slope;
  slope.value = xd / xx;
  slope.degrees = count - 1;
  slope.scatter_s2 = std::max(dd - slope.value * xd, 0.0) / slope.degrees;
  // Steep faces have long contrasts, and may scatter by more: the error also follows what each pose leaves (HC3, MacKinnon and
  // White 1985).
  double left = 0;
  for (const Pair& pair : pairs)
    left += std::pow((pair.xd - slope.value * pair.xx) / std::max(1 - pair.xx / xx, 1e-6), 2);
  slope.error = std::sqrt(std::max(slope.scatter_s2 / xx, left / (xx * xx)));
  return slope;
}

Eigen::VectorXd CentredTimes(const touches::Observations& o, int k) {
  const Eigen::Map<const Eigen::VectorXd> times_s(&o.time_s[static_cast<size_t>(k) * o.fingers], o.fingers);
  return times_s.array() - times_s.mean();
}

}  // namespace

RoundSpeed FindRoundSpeed(const touches::Observations& o) {
  std::vector<RoundsOfPose> poses(o.poses);
  const std::vector<int> round_of = touches::RoundsOfTouches(o);
  std::vector<int> rounds;
  for (int k = 0; k < o.size(); ++k) {
    const int pose = o.pose[k];
    const int round = round_of[k];
    const Eigen::VectorXd contrasts = CentredTimes(o, k);
    if (!o.used[k] || !contrasts.allFinite()) continue;
    poses[pose].emplace(round, contrasts);
    if (std::find(rounds.begin(), rounds.end(), round) == rounds.end()) rounds.push_back(round);
  }
  if (static_cast<int>(rounds.size()) < kRowCheckRules.min_rounds ||
      static_cast<int>(rounds.size()) > kRowCheckRules.max_rounds)
    return {};

  const auto without = [&rounds](std::initializer_list<int> left_out) {
    std::vector<int> rest;
    for (const int round : rounds)
      if (std::find(left_out.begin(), left_out.end(), round) == left_out.end()) rest.push_back(round);
    return rest;
  };
  RoundSpeed found;
  Slope best;
  for (const int round : rounds) {
    const std::optional<Slope> slope = SlopeOf(poses, round, without({round}));
    if (!slope || std::abs(slope->value) < kRowCheckRules.stands_out * slope->error ||
        std::abs(slope->value) < std::max(kRowCheckRules.min_speed_difference.value(), std::abs(best.value)))
      continue;
    best = *slope;
    found.round = round;
  }
  if (found.round < 0) return {};
  double others_s2 = 0, others = 0;
  for (const int round : without({found.round})) {
    const std::optional<Slope> slope = SlopeOf(poses, round, without({found.round, round}));
    if (!slope) continue;
    if (std::abs(slope->value) > kRowCheckRules.others_agree * slope->error) return {};
    others_s2 += slope->degrees * slope->scatter_s2, others += slope->degrees;
  }
  if (!(others > 0) || FisherTail(best.scatter_s2 / (others_s2 / others), best.degrees, others) <
                           kRowCheckRules.rest_is_noise_p)
    return {};
  found.factor = 1 / (1 + best.value);
  found.std_error = best.error * found.factor * found.factor;
  for (int k = 0; k < o.size(); ++k)
    if (round_of[k] == found.round) found.rows.push_back(o.row[k]);
  return found;
}

}  // namespace touchstone::diagnosis::checks
