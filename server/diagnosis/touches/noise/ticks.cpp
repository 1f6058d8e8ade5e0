#include "server/diagnosis/touches/noise/ticks.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::touches {
namespace {

// Delays of the row's contacts after its first, s; those at once have none.
std::vector<double> DelaysOf(const session::MeasurementSet& set, int row) {
  double first_s = INFINITY;
  for (int i = 0; i < set.fingers; ++i)
    if (const double time_s = set.TimeS(row, i); time_s < first_s) first_s = time_s;
  std::vector<double> delays_s;
  for (int i = 0; i < set.fingers; ++i)
    if (const double delay_s = set.TimeS(row, i) - first_s; delay_s > kNoiseRules.tick_tolerance)
      delays_s.push_back(delay_s);
  return delays_s;
}

// Those of the sorted values that stand together with more others than chance brings together.
std::vector<double> Crowded(const std::vector<double>& sorted) {
  std::vector<double> crowded;
  const double range_s = sorted.back() - sorted.front();
  const double by_chance =
      range_s > 0 ? static_cast<double>(sorted.size()) * 2 * kNoiseRules.tick_tolerance / range_s : 0;
  const double enough = std::max<double>(kNoiseRules.min_equal.value(), kNoiseRules.over_density * by_chance);
  for (size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
    for (end = begin; end < sorted.size() && sorted[end] <= sorted[begin] + 2 * kNoiseRules.tick_tolerance;)
      ++end;
    if (static_cast<double>(end - begin) >= enough)
      crowded.insert(crowded.end(), sorted.begin() + static_cast<long>(begin),
                     sorted.begin() + static_cast<long>(end));
  }
  return crowded;
}

}  // namespace

double RefinedTick(const std::vector<double>& differences, double interval_s) {
  // Refined over ever larger differences, so that the count of ticks stays certain.
  for (size_t known = 1; known < differences.size(); known *= 2) {
    double sum_nd = 0, sum_nn = 0;
    for (size_t j = 0; j < std::min(2 * known, differences.size()); ++j) {
      const double ticks = std::round(differences[j] / interval_s);
      sum_nd += ticks * differences[j], sum_nn += ticks * ticks;
    }
    if (!(sum_nn > 0)) return 0;
    interval_s = sum_nd / sum_nn;
  }
  size_t on_tick = 0;
  for (const double difference : differences)
    on_tick +=
        std::abs(difference - std::round(difference / interval_s) * interval_s) <= kNoiseRules.tick_tolerance;
  return on_tick < 0.99 * differences.size() ? 0 : interval_s;
}

double FindTick(const std::vector<double>& differences) {
  if (differences.empty()) return 0;
  // The smallest step between different values is the interval, or a small multiple of it.
  double min_gap_s = differences[0];
  for (size_t j = 1; j < differences.size(); ++j) {
    const double gap_s = differences[j] - differences[j - 1];
    if (gap_s > 2 * kNoiseRules.tick_tolerance) min_gap_s = std::min(min_gap_s, gap_s);
  }
  for (int divisor = 1; divisor <= 3 && min_gap_s / divisor >= kNoiseRules.min_tick; ++divisor)
    if (const double interval_s = RefinedTick(differences, min_gap_s / divisor); interval_s > 0)
      return interval_s;
  return 0;
}

bool LiesOnTick(const session::MeasurementSet& set, int row, double interval_s) {
  const std::vector<double> delays_s = DelaysOf(set, row);
  return std::all_of(delays_s.begin(), delays_s.end(), [interval_s](double delay_s) {
    return std::abs(delay_s - std::round(delay_s / interval_s) * interval_s) <= kNoiseRules.tick_tolerance;
  });
}

FingerTicks FindFingerTicks(const Observations& o) {
  std::vector<std::vector<double>> times_s(o.fingers);
  for (int k = 0; k < o.size(); ++k)
    for (int i = 0; i < o.fingers; ++i)
      if (const double time_s = o.set->TimeS(o.row[k], i);
          std::isfinite(time_s) && time_s > kNoiseRules.tick_tolerance)
        times_s[i].push_back(time_s);
  const auto share_on = [](const std::vector<double>& times, double interval_s) {
    const auto on = std::count_if(times.begin(), times.end(), [interval_s](double time_s) {
      return std::abs(time_s - std::round(time_s / interval_s) * interval_s) <= kNoiseRules.tick_tolerance;
    });
    return times.empty() ? 0 : static_cast<double>(on) / static_cast<double>(times.size());
  };
  for (int i = 0; i < o.fingers; ++i) {
    std::vector<double>& own = times_s[i];
    if (static_cast<int>(own.size()) < kNoiseRules.min_on_tick) continue;
    std::sort(own.begin(), own.end());
    const double interval_s = FindTick(own);
    if (interval_s == 0 || share_on(own, interval_s) < 1) continue;
    bool alone = true;
    for (int j = 0; j < o.fingers; ++j)
      alone &= j == i || share_on(times_s[j], interval_s) < kNoiseRules.max_share_of_others;
    if (alone) return {i, interval_s, static_cast<int>(own.size())};
  }
  return {};
}

TouchTicks FindTouchTicks(const Observations& o) {
  TouchTicks found;
  std::vector<double> all_s;
  std::vector<int> rows;
  for (int k = 0; k < o.size(); ++k) {
    const std::vector<double> delays_s = DelaysOf(*o.set, o.row[k]);
    if (delays_s.empty()) continue;
    rows.push_back(o.row[k]);
    all_s.insert(all_s.end(), delays_s.begin(), delays_s.end());
  }
  if (all_s.empty()) return found;
  std::sort(all_s.begin(), all_s.end());
  found.interval_s = FindTick(Crowded(all_s));
  if (found.interval_s == 0) return found;
  found.compared = static_cast<int>(rows.size());
  found.touches = static_cast<int>(std::count_if(
      rows.begin(), rows.end(), [&](int row) { return LiesOnTick(*o.set, row, found.interval_s); }));
  return found.touches < kNoiseRules.min_on_tick ? TouchTicks{} : found;
}

}  // namespace touchstone::diagnosis::touches
