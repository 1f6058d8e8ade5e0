#include "server/diagnosis/residuals/touches/describe_residuals.h"

namespace touchstone::diagnosis::residuals {

ResidualSummary DescribeResiduals(const touches::Observations& observations,
                                  const touches::Prediction& initial, const touches::Prediction& improved,
                                  const std::vector<double>& before, const std::vector<double>& after,
                                  const ResidualScale& scale) {
  ResidualSummary summary;
  summary.slices = FindSlices(observations, initial, before, scale.sigma_s);
  summary.grouped = GroupErrors(observations, before, scale.sigma_s);
  summary.finger_scatter = FindFingerScatter(observations, after);
  summary.worst_touches = FindWorstTouches(observations, before);
  summary.curves = MakeResidualCurves(observations, initial, before, after, scale.seed);
  summary.histograms = MakeHistograms(observations, initial, improved, scale);
  summary.parity = MakeParity(observations, initial, before, after);
  summary.surface_points = MakeSurfaceResiduals(observations, improved, before, after);
  summary.outlines = MakeOutlines(observations);
  summary.table = MakeTouchTable(observations, initial, before, after, summary.slices, scale.spacing_m);
  return summary;
}

}  // namespace touchstone::diagnosis::residuals
