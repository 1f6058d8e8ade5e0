#include "server/diagnosis/checks/rows/saturated_times.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "server/diagnosis/checks/rows/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

constexpr double kDigitS = 1e-6;  // files keep whole microseconds

// One finger's readings, since the first contact of their touch.
struct Reading {
  size_t entry = 0;   // k * fingers + finger
  double late_m = 0;  // by how much later it is expected
};

double FirstOf(const std::vector<double>& time_s, size_t begin, int fingers) {
  double first = INFINITY;
  for (int i = 0; i < fingers; ++i)
    if (time_s[begin + i] < first) first = time_s[begin + i];
  return first;
}

// Readings by their time in whole digits.
std::map<int64_t, std::vector<Reading>> ReadingsByTime(const touches::Observations& o,
                                                       const touches::Prediction& expected, int finger) {
  std::map<int64_t, std::vector<Reading>> by_time;
  for (int k = 0; k < o.size(); ++k) {
    const size_t begin = static_cast<size_t>(k) * o.fingers, e = begin + finger;
    if (!std::isfinite(o.time_s[e]) || !std::isfinite(expected.time_s[e])) continue;
    const double time_s = o.time_s[e] - FirstOf(o.time_s, begin, o.fingers);
    const double expected_s = expected.time_s[e] - FirstOf(expected.time_s, begin, o.fingers);
    by_time[std::llround(time_s / kDigitS)].push_back(
        {e, (expected_s - time_s) * o.set->speed_m_s[o.row[k]]});
  }
  return by_time;
}

bool IsCutOff(const std::map<int64_t, std::vector<Reading>>& by_time) {
  if (by_time.size() < 2) return false;
  const std::vector<Reading>& last = by_time.rbegin()->second;
  size_t others = 1;
  int counted = 0;
  for (auto below = std::next(by_time.rbegin());
       below != by_time.rend() && counted < kRowCheckRules.compared_times; ++below, ++counted)
    others = std::max(others, below->second.size());
  if (last.size() < std::max<double>(kRowCheckRules.min_shared, kRowCheckRules.over_others * others))
    return false;
  std::vector<double> late_m;
  for (const Reading& reading : last) late_m.push_back(reading.late_m);
  std::sort(late_m.begin(), late_m.end());
  const auto at = [&](double share) { return late_m[static_cast<size_t>(share * (late_m.size() - 1))]; };
  return at(1 - kRowCheckRules.later_share) > 0 && at(0.5) > kRowCheckRules.min_late_m &&
         at(0.75) - at(0.25) > kRowCheckRules.min_late_m;
}

}  // namespace

SaturatedTimes FindSaturatedTimes(const touches::Observations& o, const touches::Prediction& expected) {
  std::map<int64_t, std::vector<std::pair<int, std::vector<Reading>>>> cut_off;  // fingers, by the time
  for (int finger = 0; finger < o.fingers; ++finger) {
    auto by_time = ReadingsByTime(o, expected, finger);
    if (IsCutOff(by_time)) cut_off[by_time.rbegin()->first].emplace_back(finger, by_time.rbegin()->second);
  }
  SaturatedTimes most;
  for (const auto& [time, fingers] : cut_off) {
    SaturatedTimes found;
    found.time_s = static_cast<double>(time) * kDigitS;
    std::vector<int> rows;
    for (const auto& [finger, readings] : fingers) {
      found.fingers.push_back(finger);
      for (const Reading& reading : readings) {
        const int row = o.row[reading.entry / o.fingers];
        rows.push_back(row);
        found.readings.push_back(static_cast<size_t>(row) * o.fingers + finger);
      }
    }
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    found.touches = static_cast<int>(rows.size());
    found.example = rows.front();
    if (found.touches > most.touches) most = std::move(found);
  }
  return most;
}

}  // namespace touchstone::diagnosis::checks
