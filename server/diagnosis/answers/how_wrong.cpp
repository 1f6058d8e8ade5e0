#include "server/diagnosis/answers/how_wrong.h"

#include "server/diagnosis/report/kinds/from_touches.h"
#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/touches/data_summary.h"
#include "server/session/images/emulated.h"
#include "server/session/measurements/backward_times.h"
#include "server/session/measurements/touch_content.h"

namespace touchstone::diagnosis {

report::DataReport DataOf(const touches::Observations& observations, const DiagnosisInput& input) {
  report::DataReport data = report::DataOfTouches(touches::SummarizeData(observations));
  data.emulated = session::CountEmulated(*input.set);
  data.backward_times = session::FindBackwardTimes(*input.set);
  data.content_sha256 = session::TouchContentSha256(*input.set);
  return data;
}

report::Diagnosis BeginDiagnosis(const selection::Workspace& workspace) {
  report::Diagnosis diagnosis;
  diagnosis.model_name = workspace.input.model->name;
  diagnosis.model_hash = workspace.input.model->Hash();
  diagnosis.data = {DataOf(*workspace.observations, workspace.input)};
  diagnosis.warnings = workspace.warnings;
  return diagnosis;
}

void AddHowWrong(const selection::Workspace& workspace, const std::vector<double>& residuals,
                 report::Diagnosis* diagnosis) {
  report::DataReport& data = diagnosis->data[0];
  if (data.count == 0) return;
  const touches::Observations& o = *workspace.observations;
  data.noise_floor = report::InMicroseconds(selection::NoiseFloorOf(o, residuals, 0));
  data.initial = report::InMicroseconds(selection::QualityAsCompared(o, residuals));
  data.final = data.initial;
  data.reducible_share = report::ReducibleShare(*data.noise_floor, data.initial->rmse);
}

}  // namespace touchstone::diagnosis
