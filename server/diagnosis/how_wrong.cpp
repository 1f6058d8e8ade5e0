#include "server/diagnosis/how_wrong.h"

#include <algorithm>

#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/touches/data_summary.h"

namespace touchstone::diagnosis {

report::Diagnosis BeginDiagnosis(const selection::Workspace& workspace) {
  report::Diagnosis diagnosis;
  diagnosis.model_name = workspace.input.model->name;
  diagnosis.model_hash = workspace.input.model->Hash();
  diagnosis.data = touches::SummarizeData(*workspace.observations);
  diagnosis.warnings = workspace.warnings;
  return diagnosis;
}

double ReducibleShare(const engine::NoiseFloor& floor, const engine::Quality& quality) {
  const double noise_s2 = floor.sigma * floor.sigma, error_s2 = quality.rmse * quality.rmse;
  return error_s2 > 0 ? std::clamp(1 - noise_s2 / error_s2, 0.0, 1.0) : 0;
}

void AddHowWrong(const selection::Workspace& workspace, const std::vector<double>& residuals,
                 report::Diagnosis* diagnosis) {
  if (diagnosis->data.touches == 0) return;
  const touches::Observations& o = *workspace.observations;
  const double rmse_s = touches::Rmse(o, residuals);
  diagnosis->noise_floor = selection::NoiseFloorOf(o, residuals, 0);
  diagnosis->initial = {rmse_s, rmse_s, selection::LackOfFitP(o, residuals, 0)};
  diagnosis->final = diagnosis->initial;
  diagnosis->reducible_share = ReducibleShare(*diagnosis->noise_floor, *diagnosis->initial);
}

}  // namespace touchstone::diagnosis
