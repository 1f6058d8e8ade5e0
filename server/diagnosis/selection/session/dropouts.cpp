#include "server/diagnosis/selection/session/dropouts.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/diagnosis/touches/noise/noise_sample.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::selection {
namespace {

struct Level {
  std::string name;  // "finger r"
  double expected = 0, silent = 0;
};

double LogOfShare(double part, double of, double share) {
  return part > 0 ? part * std::log(part / (of * share)) : 0;
}

// Likelihood ratio of one share per level over one share for all. The fingers of a touch may fall silent together:
// they count as one reading.
double DifferenceP(const std::vector<Level>& levels, int fingers) {
  double expected = 0, silent = 0, gain = 0;
  for (const Level& level : levels) expected += level.expected, silent += level.silent;
  int with_readings = 0;
  for (const Level& level : levels) {
    if (level.expected == 0) continue;
    ++with_readings;
    gain += LogOfShare(level.silent, level.expected, silent / expected) +
            LogOfShare(level.expected - level.silent, level.expected, 1 - silent / expected);
  }
  if (with_readings < 2 || !(gain > 0)) return 1;
  return ChiSquaredTail(2 * gain / fingers, with_readings - 1);
}

std::string InWords(const std::vector<Level>& levels) {
  const auto share = [](const Level& level) {
    return level.expected > 0 ? level.silent / level.expected : 0;
  };
  const Level& most = *std::max_element(levels.begin(), levels.end(),
                                        [&](const Level& a, const Level& b) { return share(a) < share(b); });
  Level others;
  for (const Level& level : levels)
    if (&level != &most) others.expected += level.expected, others.silent += level.silent;
  return absl::StrFormat("Contacts are missed most often %s: %.3g %% of them, %.3g %% elsewhere.", most.name,
                         100 * share(most), 100 * share(others));
}

}  // namespace

std::string DropoutsInWords(const touches::Observations& o, const touches::Prediction& prediction) {
  const std::vector<char> expected = touches::ExpectedReadings(o, prediction);
  const std::vector<double> tangents = touches::TangentsOfIncidence(prediction);
  std::vector<double> sorted;
  for (size_t e = 0; e < expected.size(); ++e)
    if (expected[e]) sorted.push_back(tangents[e]);
  if (sorted.empty()) return "";
  const auto middle = sorted.begin() + static_cast<long>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());

  std::vector<Level> by_finger, by_object,
      by_slope = {{"on the steeper half of the contacts"}, {"on the flatter half of the contacts"}};
  for (int i = 0; i < o.fingers; ++i)
    by_finger.push_back({absl::StrCat("by finger ", model::FingerName(i, o.fingers))});
  for (const std::string& object : o.objects) by_object.push_back({absl::StrCat("on ", object)});
  double silent_rows = 0, silent_readings = 0;
  for (int k = 0; k < o.size(); ++k) {
    bool any = false;
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      const bool silent = std::isnan(o.time_s[e]);
      any |= !silent;
      if (!expected[e]) continue;
      silent_readings += silent;
      for (Level* level : {&by_finger[i], &by_object[o.object[k]], &by_slope[tangents[e] > *middle ? 0 : 1]})
        level->expected += 1, level->silent += silent;
    }
    silent_rows += !any;
  }
  std::string words;
  if (silent_rows > kSessionRules.silent_rows * o.size())
    words = absl::StrFormat("In %.0f of %d rows no finger reported.", silent_rows, o.size());
  if (silent_readings < kSessionRules.min_silent) return words;
  double min_p = kSessionRules.missed_p;
  std::string where;
  for (const std::vector<Level>* levels : {&by_finger, &by_object, &by_slope}) {
    const double p = DifferenceP(*levels, o.fingers);
    if (p < min_p) min_p = p, where = InWords(*levels);
  }
  return absl::StrCat(words, words.empty() || where.empty() ? "" : " ", where);
}

}  // namespace touchstone::diagnosis::selection
