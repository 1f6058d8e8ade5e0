#include "server/diagnosis/touches/data_summary.h"

#include <cmath>
#include <set>

#include "server/base/units.h"
#include "server/diagnosis/touches/rules.h"

namespace touchstone::diagnosis::touches {
DataSummary SummarizeData(const Observations& o) {
  const session::MeasurementSet& set = *o.set;
  DataSummary data;
  data.origin = set.origin;
  data.fingers = o.fingers;
  data.rows = set.size();
  for (const auto& [reason, touches] : o.unused) {
    UnusedTouches& unused = data.unused[reason];
    unused.count = static_cast<int>(touches.size());
    for (size_t i = 0; i < touches.size() && i < kTouchRules.max_examples; ++i)
      unused.examples.push_back(set.touch[o.row[touches[i]]]);
  }
  data.outliers = static_cast<int>(LeftOutFor(o, kOutlierReason).size());
  data.objects = o.objects;
  std::set<int> poses, rounds;
  std::set<double> speeds_mm_s;
  for (int k = 0; k < o.size(); ++k) {
    for (int i = 0; i < o.fingers; ++i)
      data.missed_contacts += std::isnan(o.time_s[static_cast<size_t>(k) * o.fingers + i]);
    if (!o.used[k]) continue;
    ++data.touches;
    poses.insert(o.pose[k]);
    if (!set.round.empty()) rounds.insert(set.round[o.row[k]]);
    // To a micrometre per second: what files write.
    if (speeds_mm_s.size() < kTouchRules.max_speeds)
      speeds_mm_s.insert(std::round(set.speed_m_s[o.row[k]] * 1e6) / kMillimetresPerMetre);
  }
  data.poses = static_cast<int>(poses.size());
  data.repeats = data.touches - data.poses;
  data.rounds = static_cast<int>(rounds.size());
  data.speeds_mm_s.assign(speeds_mm_s.begin(), speeds_mm_s.end());
  return data;
}

}  // namespace touchstone::diagnosis::touches
