#include "server/diagnosis/residuals/touches/touch_table.h"

#include <absl/strings/match.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/slices/covariates.h"
#include "server/diagnosis/residuals/touches/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// Values of every cell; of every touch where its fingers agree throughout.
TableCovariate TableColumn(const ResidualCovariate& covariate, const std::vector<int>& touches, int fingers) {
  TableCovariate column{covariate.name, covariate.unit, covariate.labels, {}};
  bool per_finger = false;
  for (const int k : touches) {
    const double first = covariate.value(k, 0);
    for (int i = 0; i < fingers; ++i) {
      const double value = covariate.value(k, i);
      per_finger |= value != first && !(std::isnan(value) && std::isnan(first));
      column.values.push_back(value);
    }
  }
  if (per_finger) return column;
  for (size_t n = 0; n < touches.size(); ++n) column.values[n] = column.values[n * fingers];
  column.values.resize(touches.size());
  return column;
}

}  // namespace

TouchTable MakeTouchTable(const touches::Observations& observations, const touches::Prediction& initial,
                          const std::vector<double>& before, const std::vector<double>& after,
                          const std::vector<ErrorSlice>& slices, double spacing_m) {
  TouchTable table;
  if (initial.contact_m.empty()) return table;
  const int fingers = observations.fingers;
  const session::MeasurementSet& set = *observations.set;
  const std::vector<int> touches =
      ThinnedTouches(observations, before, kTouchResidualRules.max_table_touches);
  table.spacing_m = spacing_m;
  for (int k = 0; k < observations.size(); ++k)
    table.touches_in_all += observations.used[k] && FingersCompared(observations, before, k) > 1;
  table.slice_cells.resize(slices.size());
  for (const int k : touches) {
    const int row = observations.row[k];
    const size_t first = size_t(k) * fingers;
    table.touch.push_back(set.touch[row]);
    table.object.push_back(observations.object[k]);
    table.target_m.push_back(set.target_m[row]);
    table.approach.push_back(set.approach[row]);
    table.lateral.push_back(set.lateral[row]);
    table.standoff_m.push_back(set.standoff_m[row]);
    double mean_s = 0;
    for (size_t cell = first; cell < first + fingers; ++cell)
      if (!std::isnan(before[cell])) mean_s += initial.time_s[cell];
    mean_s /= FingersCompared(observations, before, k);
    for (size_t cell = first; cell < first + fingers; ++cell) {
      for (size_t s = 0; s < slices.size(); ++s)
        if (slices[s].cells[cell])
          table.slice_cells[s].push_back(static_cast<uint32_t>(table.residual_s.size()));
      table.contact_m.push_back(initial.contact_m[cell]);
      table.simulated_s.push_back(std::isnan(before[cell]) ? NAN : initial.time_s[cell] - mean_s);
      table.residual_s.push_back(before[cell]);
      table.after_s.push_back(after[cell]);
    }
  }
  for (const ResidualCovariate& covariate : ListResidualCovariates(observations, initial))
    if (!absl::StartsWith(covariate.name, "contact_"))
      table.covariates.push_back(TableColumn(covariate, touches, fingers));
  return table;
}

}  // namespace touchstone::diagnosis::residuals
