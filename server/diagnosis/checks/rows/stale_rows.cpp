#include "server/diagnosis/checks/rows/stale_rows.h"

#include "server/diagnosis/checks/rows/rules.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::diagnosis::checks {
namespace {

// One pose in a row may well give the same times again.
bool SamePose(const session::MeasurementSet& set, int a, int b) {
  return set.object[a] == set.object[b] && set.target_m[a] == set.target_m[b] &&
         set.approach[a] == set.approach[b] && set.lateral[a] == set.lateral[b];
}

}  // namespace

StaleRows FindStaleRows(const session::MeasurementSet& set) {
  StaleRows found;
  int alike = 0;
  for (int row = 0; row < set.size(); ++row) {
    if (session::RepeatsRow(set, row, 1) && !SamePose(set, row, row - 1)) {
      ++found.rows;
      if (found.example < 0) found.example = row;
    }
    for (int lag = kRowCheckRules.first_lag; lag <= kRowCheckRules.last_lag; ++lag)
      if (row >= lag && !SamePose(set, row, row - lag)) alike += session::RepeatsRow(set, row, lag);
  }
  found.expected = static_cast<double>(alike) / (kRowCheckRules.last_lag - kRowCheckRules.first_lag + 1);
  return found.rows > kRowCheckRules.min_beyond_chance + kRowCheckRules.over_chance * found.expected
             ? found
             : StaleRows{};
}

}  // namespace touchstone::diagnosis::checks
