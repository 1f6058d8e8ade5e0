#include "server/diagnosis/selection/session/session_order.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/selection/session/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSecondsPerHour = 3600;

// The first and last touch of an object.
struct Stretch {
  int first = -1, last = -1;
};

std::map<int, Stretch> StretchesOfObjects(const touches::Observations& o) {
  std::map<int, Stretch> stretches;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    Stretch& stretch = stretches[o.object[k]];
    if (stretch.first < 0) stretch.first = k;
    stretch.last = k;
  }
  return stretches;
}

int OthersBetween(const touches::Observations& o, const Stretch& stretch, int object) {
  int others = 0;
  for (int k = stretch.first; k <= stretch.last; ++k) others += o.used[k] && o.object[k] != object;
  return others;
}

// By how much the values grow in an hour, if a line of time describes them; 0: it does not.
double GrowthPerHour(const touches::Observations& o, const std::map<int, Stretch>& stretches,
                     const std::vector<engine::ParameterEstimate>& values) {
  double w = 0, wt = 0, wtt = 0, wv = 0, wtv = 0, wvv = 0;
  size_t count = 0;
  for (const engine::ParameterEstimate& value : values) {
    const auto object = std::find(o.objects.begin(), o.objects.end(), value.object);
    if (object == o.objects.end() || !value.entry.empty() || !(value.std_error > 0)) return 0;
    const auto stretch = stretches.find(static_cast<int>(object - o.objects.begin()));
    if (stretch == stretches.end()) continue;
    const double hours = 0.5 *
                         (o.set->session_time_s[o.row[stretch->second.first]] +
                          o.set->session_time_s[o.row[stretch->second.last]]) /
                         kSecondsPerHour;
    const double weight = 1 / (value.std_error * value.std_error);
    w += weight, wt += weight * hours, wtt += weight * hours * hours;
    wv += weight * value.value, wtv += weight * hours * value.value,
        wvv += weight * value.value * value.value;
    ++count;
  }
  if (count < kSessionRules.min_objects_in_line) return 0;
  const double time2 = wtt - wt * wt / w;
  if (!(time2 > 0)) return 0;
  const double slope = (wtv - wt * wv / w) / time2;
  const double rest = wvv - wv * wv / w - slope * slope * time2;
  const bool grows = std::abs(slope) * std::sqrt(time2) > kSessionRules.slope_errors;
  return grows && ChiSquaredTail(rest, static_cast<double>(count - 2)) > kSessionRules.line_p ? slope : 0;
}

}  // namespace

std::string OrderInWords(const touches::Observations& o, const std::string& only,
                         const std::vector<engine::ParameterEstimate>& values, bool own_by_nature) {
  const std::map<int, Stretch> stretches = StretchesOfObjects(o);
  if (stretches.size() < 2 || (own_by_nature && !only.empty())) return "";
  for (const auto& [object, stretch] : stretches) {
    if (!only.empty() && o.objects[object] != only) continue;
    if (OthersBetween(o, stretch, object) > 0) return "";
    if (!only.empty())
      return absl::StrFormat(
          "Nothing else was touched from touch %d to touch %d: what changed in that time would look alike. "
          "Touch the objects in turns to tell.",
          o.set->touch[o.row[stretch.first]], o.set->touch[o.row[stretch.last]]);
  }
  const double growth = o.set->has_session_time ? GrowthPerHour(o, stretches, values) : 0;
  if (growth != 0)
    return absl::StrFormat(
        "The values grow steadily in the order in which the objects were touched, by %.3g%s an hour: growth "
        "with time (a tip that wears, a part that warms) would look alike. Touch the objects in turns to "
        "tell.",
        growth, values[0].unit.empty() ? "" : " " + values[0].unit);
  if (own_by_nature) return "";
  return "The objects were touched one after another: a change with time would look alike. Touch them in "
         "turns "
         "to tell.";
}

std::vector<std::pair<size_t, size_t>> PairsAtTwoSpeeds(const touches::Observations& o,
                                                        const std::vector<int>& touch_of_row,
                                                        const engine::Fit& fit,
                                                        const std::vector<engine::SelectedStep>& steps) {
  std::set<double> speeds;
  for (const int k : touch_of_row) speeds.insert(o.set->speed_m_s[o.row[k]]);
  if (speeds.size() != 2) return {};
  const auto columns_of = [&](const engine::SelectedStep& step) {
    std::vector<int> columns;
    for (int i = 0; i < fit.model.size(); ++i)
      if (fit.model.parameters()[i].effect == step.effect) columns.push_back(1 + i);
    return columns;
  };
  // Cosine of two columns over the rows of one speed; 0: over all rows.
  const auto cosine = [&](int one, int other, double speed) {
    double ab = 0, aa = 0, bb = 0;
    for (Eigen::Index row = 0; row < fit.columns.values.rows(); ++row) {
      if (speed != 0 && o.set->speed_m_s[o.row[touch_of_row[row]]] != speed) continue;
      const double a = fit.columns.values(row, one), b = fit.columns.values(row, other);
      ab += a * b, aa += a * a, bb += b * b;
    }
    return aa > 0 && bb > 0 ? std::abs(ab) / std::sqrt(aa * bb) : 0;
  };
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < steps.size(); ++i)
    for (size_t j = i + 1; j < steps.size(); ++j) {
      const std::vector<int> one = columns_of(steps[i]), other = columns_of(steps[j]);
      if (one.empty() || one.size() != other.size()) continue;
      bool same = true, apart = false;
      for (size_t c = 0; c < one.size(); ++c) {
        for (const double speed : speeds)
          same &= cosine(one[c], other[c], speed) > kSessionRules.same_pattern;
        apart |= cosine(one[c], other[c], 0) < kSessionRules.same_pattern;
      }
      if (same && apart) pairs.emplace_back(i, j);
    }
  return pairs;
}

}  // namespace touchstone::diagnosis::selection
