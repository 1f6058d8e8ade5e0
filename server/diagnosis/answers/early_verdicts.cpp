#include "server/diagnosis/answers/early_verdicts.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/diagnosis/answers/how_wrong.h"
#include "server/diagnosis/answers/rules.h"
#include "server/diagnosis/checks/data_problems.h"
#include "server/diagnosis/report/kinds/from_touches.h"
#include "server/diagnosis/report/words/summary.h"

namespace touchstone::diagnosis {
namespace {

report::Diagnosis ReportOf(const selection::Workspace& workspace) {
  report::Diagnosis diagnosis = BeginDiagnosis(workspace);
  AddHowWrong(workspace, touches::Residuals(*workspace.observations, workspace.nominal), &diagnosis);
  return diagnosis;
}

}  // namespace

report::Diagnosis CheckDataReport(const DiagnosisInput& input, const DiagnosisContext& context,
                                  const std::vector<engine::DataProblem>& problems) {
  report::Diagnosis diagnosis;
  const auto workspace = selection::MakeWorkspace(input, context);
  if (workspace.ok()) {
    diagnosis = ReportOf(**workspace);
  } else {
    // The mistake makes the file contradict the meshes or the units, which would be an error without it.
    diagnosis.model_name = input.model->name;
    diagnosis.model_hash = input.model->Hash();
    const auto o = touches::MakeObservations(input);
    diagnosis.data = {o.ok() ? DataOf(*o, input) : report::DataReport()};
    diagnosis.data[0].session = input.set->origin;
    const double before_s = problems.empty() ? NAN : problems[0].error_before;
    if (before_s > 0)
      diagnosis.data[0].initial = diagnosis.data[0].final =
          report::InMicroseconds(report::Quality{before_s, before_s, 0});
  }
  diagnosis.verdict = engine::Verdict::kCheckData;
  for (const engine::DataProblem& problem : problems)
    diagnosis.data_problems.push_back(report::InMicroseconds(problem));
  diagnosis.summary = report::Summarize(diagnosis);
  return diagnosis;
}

absl::Status WithFix(const absl::Status& refusal, const DiagnosisInput& input,
                     const DiagnosisContext& context) {
  if (!absl::IsInvalidArgument(refusal)) return refusal;
  const auto problems = checks::FindDataProblems(input, context);
  if (!problems.ok()) return refusal;
  for (const engine::DataProblem& problem : *problems)
    if (!problem.fix.empty())
      return absl::InvalidArgumentError(absl::StrCat(refusal.message(), " Fix it with: ", problem.fix));
  return refusal;
}

int TouchesNeeded(const touches::Observations& o) {
  std::set<int> poses;
  int used = 0, contrasts = 0;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    ++used;
    poses.insert(o.pose[k]);
    int reporting = 0;
    for (int i = 0; i < o.fingers; ++i)
      reporting += !std::isnan(o.time_s[static_cast<size_t>(k) * o.fingers + i]);
    contrasts += reporting - 1;
  }
  const int needed = kAnswerRules.fitted_values + kAnswerRules.spare_degrees_of_freedom;
  if (contrasts >= needed && static_cast<int>(poses.size()) >= kAnswerRules.min_poses) return 0;
  // Fingers that stay silent make more touches necessary.
  const double per_touch = used > 0 ? static_cast<double>(contrasts) / used : o.fingers - 1;
  const int touches = static_cast<int>(std::ceil(needed / std::max(per_touch, 1.0)));
  return static_cast<int>(poses.size()) >= kAnswerRules.min_poses
             ? touches
             : std::max(touches, used + kAnswerRules.min_poses - static_cast<int>(poses.size()));
}

report::Diagnosis TooLittleDataReport(const selection::Workspace& workspace, int touches_needed) {
  report::Diagnosis diagnosis = ReportOf(workspace);
  diagnosis.verdict = engine::Verdict::kTooLittleData;
  diagnosis.data[0].needed = touches_needed;
  for (std::string& warning : report::DataWarnings(diagnosis.data[0]))
    diagnosis.warnings.push_back(std::move(warning));
  diagnosis.summary = report::Summarize(diagnosis);
  return diagnosis;
}

}  // namespace touchstone::diagnosis
