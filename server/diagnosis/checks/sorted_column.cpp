#include "server/diagnosis/checks/sorted_column.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/checks/rules.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::checks {
namespace {

// Values of one finger in the order of the file: how many steps go up and how many down.
struct Steps {
  int up = 0, down = 0;
};

Steps StepsOf(const std::vector<double>& values) {
  Steps steps;
  double last = NAN;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    steps.up += value > last;
    steps.down += value < last;
    last = value;
  }
  return steps;
}

}  // namespace

int SortedColumn(const DiagnosisInput& input) {
  const session::MeasurementSet& set = *input.set;
  for (int finger = 0; finger < set.fingers; ++finger) {
    std::vector<double> column(set.size());
    for (int row = 0; row < set.size(); ++row) column[row] = set.TimeS(row, finger);
    const Steps measured = StepsOf(column);
    if (std::min(measured.up, measured.down) > 0 ||
        measured.up + measured.down < kCheckRules.min_distinct_steps)
      continue;
    const absl::StatusOr<touches::Observations> o = touches::MakeObservations(input);
    if (!o.ok()) return -1;
    const absl::StatusOr<touches::Prediction> predicted =
        touches::Predict(*o, *input.model, false, false, nullptr);
    if (!predicted.ok()) return -1;
    // Relative to the first finger, as files have them.
    std::vector<double> expected(set.size(), NAN);
    for (int k = 0; k < o->size(); ++k) {
      const double* times_s = &predicted->time_s[static_cast<size_t>(k) * set.fingers];
      double first_s = INFINITY;
      for (int i = 0; i < set.fingers; ++i)
        if (times_s[i] < first_s) first_s = times_s[i];
      if (!std::isnan(column[o->row[k]])) expected[o->row[k]] = times_s[finger] - first_s;
    }
    const Steps model = StepsOf(expected);
    if (std::min(model.up, model.down) > kCheckRules.min_up_and_down * (model.up + model.down)) return finger;
  }
  return -1;
}

}  // namespace touchstone::diagnosis::checks
