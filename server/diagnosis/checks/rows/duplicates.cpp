#include "server/diagnosis/checks/rows/duplicates.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/diagnosis/checks/rows/rules.h"
#include "server/diagnosis/touches/noise/ticks.h"

namespace touchstone::diagnosis::checks {
namespace {

// The smallest step between times of the file.
double ResolutionS(const session::MeasurementSet& set) {
  std::vector<double> times;
  for (const double time_s : set.time_s)
    if (time_s > 0) times.push_back(time_s);
  std::sort(times.begin(), times.end());
  double tick_s = INFINITY;
  for (size_t i = 1; i < times.size(); ++i)
    if (times[i] - times[i - 1] > kRowCheckRules.finest_tick_s)
      tick_s = std::min(tick_s, times[i] - times[i - 1]);
  return std::isfinite(tick_s) ? tick_s : 0;
}

double ModelNoiseS(const model::Model& model) {
  double variance = 0;
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->role == model::EffectRole::kNoiseLevel && !instance.values.empty())
      variance += instance.values[0] * instance.values[0];
  return std::sqrt(variance);
}

// Rows of one commanded touch: how often each result stands there, and the scatter of those that differ.
struct Pose {
  std::vector<int> first;  // rows with different times
  int rows = 0;
};

}  // namespace

Duplicates FindDuplicates(const touches::Observations& o, const model::Model& model) {
  const session::MeasurementSet& set = *o.set;
  std::vector<int> copies;  // rows
  std::vector<Pose> poses(o.poses);
  std::vector<int> pose_of_row(set.size(), -1);
  for (int k = 0; k < o.size() && set.has_poses; ++k) pose_of_row[o.row[k]] = o.pose[k];
  bool equal_session_times = set.has_session_time;
  for (int row = 0; row < set.size(); ++row) {
    const double* times_s = &set.time_s[static_cast<size_t>(row) * set.fingers];
    const auto reported =
        std::count_if(times_s, times_s + set.fingers, [](double t) { return !std::isnan(t); });
    if (reported < 2 || pose_of_row[row] < 0) continue;
    Pose& pose = poses[pose_of_row[row]];
    ++pose.rows;
    const auto same = std::find_if(pose.first.begin(), pose.first.end(), [&](int other) {
      for (int i = 0; i < set.fingers; ++i)
        if (!(set.TimeS(other, i) == times_s[i] ||
              (std::isnan(set.TimeS(other, i)) && std::isnan(times_s[i]))))
          return false;
      return true;
    });
    if (same == pose.first.end()) {
      pose.first.push_back(row);
      continue;
    }
    copies.push_back(row);
    equal_session_times &= set.session_time_s[row] == set.session_time_s[*same];
  }
  if (static_cast<double>(copies.size()) <
      std::max<double>(kRowCheckRules.min_beyond_chance, kRowCheckRules.min_copy_share * set.size()))
    return {};

  double squares = 0, freedom = 0, pairs = 0;
  for (const Pose& pose : poses) {
    pairs += 0.5 * pose.rows * (pose.rows - 1);
    if (pose.first.size() < 2) continue;
    for (int i = 1; i < set.fingers; ++i) {
      double sum = 0, sum_of_squares = 0;
      int count = 0;
      for (const int row : pose.first) {
        const double gap_s = set.TimeS(row, i) - set.TimeS(row, 0);
        if (!std::isnan(gap_s)) sum += gap_s, sum_of_squares += gap_s * gap_s, ++count;
      }
      if (count < 2) continue;
      squares += sum_of_squares - sum * sum / count;
      freedom += count - 1;
    }
  }
  const double sigma_s = freedom >= kRowCheckRules.min_scatter_dof
                             ? std::sqrt(std::max(squares, 0.0) / freedom)
                             : ModelNoiseS(model);
  if (!(sigma_s > 0))
    return equal_session_times ? Duplicates{static_cast<int>(copies.size()), 0, copies[0]} : Duplicates{};
  // Copies on a tick of the sensor are expected with the tick, all others with the resolution of the file.
  const double tick_s = touches::FindTouchTicks(o).interval_s;
  const auto first_untidy = std::stable_partition(copies.begin(), copies.end(), [&](int row) {
    return tick_s > 0 && touches::LiesOnTick(set, row, tick_s);
  });
  Duplicates found;
  const auto judge = [&](auto begin, auto end, double step_s) {
    // Two normal numbers of a common mean fall on one tick with tick / (2 sqrt(pi) sigma).
    const double match = std::min(1.0, step_s / (2 * std::sqrt(M_PI) * sigma_s));
    const double expected = pairs * std::pow(match, set.fingers - 1);
    if (static_cast<double>(end - begin) <=
        kRowCheckRules.min_beyond_chance + kRowCheckRules.over_chance * expected)
      return;
    found.rows += static_cast<int>(end - begin);
    found.expected += expected;
    for (auto copy = begin; copy != end; ++copy)
      if (found.example < 0 || *copy < found.example) found.example = *copy;
  };
  judge(copies.begin(), first_untidy, tick_s);
  judge(first_untidy, copies.end(), ResolutionS(set));
  return found;
}

}  // namespace touchstone::diagnosis::checks
