// What the pictures and tables of a report show of the residuals: where the model is wrong, errors by group,
// residuals over covariates, histograms, parity, points on the surfaces.
#pragma once

#include <vector>

#include "server/diagnosis/residuals/distribution/histograms.h"
#include "server/diagnosis/residuals/distribution/parity.h"
#include "server/diagnosis/residuals/slices/curves.h"
#include "server/diagnosis/residuals/slices/slices.h"
#include "server/diagnosis/residuals/touches/finger_scatter.h"
#include "server/diagnosis/residuals/touches/groups.h"
#include "server/diagnosis/residuals/touches/outlines.h"
#include "server/diagnosis/residuals/touches/surface_points.h"
#include "server/diagnosis/residuals/touches/touch_table.h"
#include "server/diagnosis/residuals/touches/worst_touches.h"

namespace touchstone::diagnosis::residuals {

// Each part is documented at its type. Fingers are numbered, 0 is the first.
struct ResidualSummary {
  std::vector<ErrorSlice> slices;
  GroupedErrors grouped;
  std::optional<FingerScatter> finger_scatter;  // of what the improved model leaves
  std::vector<WorstTouch> worst_touches;
  std::vector<ResidualCurve> curves;
  std::vector<ComparedHistogram> histograms;
  std::vector<ParityPoint> parity;
  std::vector<SurfaceResidual> surface_points;
  std::vector<DrawableObject> outlines;
  TouchTable table;
};

// `before` and `after` are the residuals of the predictions `initial` and `improved`, which may be the same:
// [k * fingers + finger], seconds, NaN where a finger takes no part. Deterministic.
ResidualSummary DescribeResiduals(const touches::Observations& observations,
                                  const touches::Prediction& initial, const touches::Prediction& improved,
                                  const std::vector<double>& before, const std::vector<double>& after,
                                  const ResidualScale& scale);

}  // namespace touchstone::diagnosis::residuals
