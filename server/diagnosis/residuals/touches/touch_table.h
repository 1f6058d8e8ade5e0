// The touches behind a report, one by one: for a page that links a residual to its touch.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/residuals/slices/slices.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

struct TableCovariate {
  std::string name, unit;           // as of ResidualCovariate
  std::vector<std::string> labels;  // of a category; its values are indices into these
  std::vector<double> values;       // [n], or [n * fingers + finger] where fingers differ; NaN: unknown
};

// Touches n = 0 .. size()-1 in the order of the session. A cell is one finger of one touch, [n * fingers + finger].
struct TouchTable {
  int touches_in_all = 0;  // that take part: more than size() where the table is a sample
  double spacing_m = 0;    // of the fingers, as the model has it
  std::vector<uint64_t> touch;
  std::vector<int> object;                                   // index into the set's objects
  std::vector<Eigen::Vector3d> target_m, approach, lateral;  // commanded
  std::vector<double> standoff_m;                            // commanded
  std::vector<Eigen::Vector3d> contact_m;                    // of cells, by the initial model; NaN: it misses
  std::vector<double> simulated_s, residual_s, after_s;      // of cells, see below
  std::vector<TableCovariate> covariates;                    // without the contact point
  std::vector<std::vector<uint32_t>> slice_cells;            // of each slice, rising

  int size() const { return static_cast<int>(touch.size()); }
};

// At most about TouchResidualRules::max_table_touches, whole poses. simulated_s: the initial model's time less the mean over
// the touch's compared fingers. residual_s and after_s are `before` and `after`, [k * fingers + finger], seconds, NaN where a finger
// takes no part. Empty if the prediction has no contacts.
TouchTable MakeTouchTable(const touches::Observations& observations, const touches::Prediction& initial,
                          const std::vector<double>& before, const std::vector<double>& after,
                          const std::vector<ErrorSlice>& slices, double spacing_m);

}  // namespace touchstone::diagnosis::residuals
