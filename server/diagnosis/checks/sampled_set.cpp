#include "server/diagnosis/checks/sampled_set.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnosis/checks/rules.h"

namespace touchstone::diagnosis::checks {

std::vector<int> SampleRows(const touches::Observations& o) {
  // Of each object the poses in the order of the session, and the touches of each pose.
  std::vector<std::vector<std::vector<int>>> poses(o.objects.size());
  std::map<int, size_t> place;  // pose -> index among its object's
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    auto& of_object = poses[o.object[k]];
    const auto [found, is_new] = place.emplace(o.pose[k], of_object.size());
    if (is_new) of_object.emplace_back();
    of_object[found->second].push_back(k);
  }
  const int quota = std::max<int>(kCheckRules.min_sampled_of_object,
                                  kCheckRules.sampled_touches / std::max<size_t>(o.objects.size(), 1));
  std::vector<int> rows;
  for (const auto& of_object : poses) {
    // Poses spread evenly, and of each another repeat than of the one before; then further repeats.
    const int count = static_cast<int>(of_object.size());
    int taken = 0;
    for (size_t round = 0; taken < quota && count > 0; ++round) {
      const int wanted = std::min(quota - taken, count);
      bool any = false;
      for (int i = 0; i < wanted; ++i) {
        const int pose = static_cast<int>((i + 0.5) * count / wanted);
        const std::vector<int>& repeats = of_object[pose];
        if (round >= repeats.size()) continue;
        rows.push_back(o.row[repeats[(pose + round) % repeats.size()]]);
        ++taken, any = true;
      }
      if (!any) break;
    }
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

std::shared_ptr<session::MeasurementSet> PartOf(const session::MeasurementSet& set,
                                                const std::vector<int>& rows, int shift) {
  auto part = std::make_shared<session::MeasurementSet>();
  part->origin = set.origin;
  part->fingers = set.fingers;
  part->has_poses = set.has_poses;
  part->has_session_time = set.has_session_time;
  part->objects = set.objects;
  for (const int row : rows) {
    part->touch.push_back(set.touch[row]);
    part->object.push_back(set.object[row]);
    part->target_m.push_back(set.target_m[row]);
    part->approach.push_back(set.approach[row]);
    part->lateral.push_back(set.lateral[row]);
    part->standoff_m.push_back(set.standoff_m[row]);
    part->speed_m_s.push_back(set.speed_m_s[row]);
    part->session_time_s.push_back(set.session_time_s[row]);
    part->line.push_back(set.line[row]);
    for (const auto& [name, values] : set.covariates) part->covariates[name].push_back(values[row]);
    const int from = row - shift;
    for (int i = 0; i < set.fingers; ++i)
      part->time_s.push_back(from >= 0 && from < set.size() ? set.TimeS(from, i) : NAN);
  }
  return part;
}

}  // namespace touchstone::diagnosis::checks
