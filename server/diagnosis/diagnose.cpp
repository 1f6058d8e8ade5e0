#include "server/diagnosis/diagnose.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/diagnosis/answers/explain_reports.h"
#include "server/diagnosis/answers/plan_reports.h"
#include "server/diagnosis/answers/uncertainty_reports.h"
#include "server/diagnosis/joint_reports.h"
#include "server/diagnosis/photograph_reports.h"
#include "server/diagnosis/session_reports.h"
#include "server/diagnosis/touch_reports.h"

namespace touchstone::diagnosis {
namespace {

// A set that the model was fitted to has nothing unseen under it.
void TellWhatWasSeen(const DiagnosisInput& input, report::Diagnosis* diagnosis) {
  for (report::DataReport& data : diagnosis->data) {
    if (data.content_sha256.empty() || !data.initial ||
        std::find(input.fitted_to.begin(), input.fitted_to.end(), data.content_sha256) ==
            input.fitted_to.end())
      continue;
    data.initial->heldout_rmse = 0;
    if (data.final && !diagnosis->improved_model) data.final->heldout_rmse = 0;
    diagnosis->warnings.push_back(absl::StrCat("The model was fitted to this set",
                                               data.session.empty() ? "" : ", ", data.session,
                                               ": its error here is not one on unseen measurements."));
  }
}

absl::StatusOr<report::Diagnosis> Compared(const DiagnosisInput& input, const DiagnosisContext& context) {
  if (input.images == nullptr) return CompareTouches(input, context);
  return input.set == nullptr ? ComparePhotographSet(input, context) : CompareJointSet(input, context);
}

absl::StatusOr<report::Diagnosis> Diagnosed(const DiagnosisInput& input, const DiagnosisContext& context) {
  if (input.images == nullptr) return DiagnoseTouches(input, context);
  return input.set == nullptr ? DiagnosePhotographSet(input, context) : DiagnoseJointSet(input, context);
}

}  // namespace

absl::StatusOr<report::Diagnosis> Compare(const DiagnosisInput& input, const DiagnosisContext& context) {
  if (input.other_model != nullptr &&
      (input.images != nullptr || input.set == nullptr || !input.set->has_poses))
    return absl::InvalidArgumentError(
        "two models are compared on touches with poses; photographs and sets without poses take one model");
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis diagnosis, Compared(input, context));
  TellWhatWasSeen(input, &diagnosis);
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> Diagnose(const DiagnosisInput& input, const DiagnosisContext& context) {
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis diagnosis, Diagnosed(input, context));
  TellWhatWasSeen(input, &diagnosis);
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> Compare(const std::vector<DiagnosisInput>& sessions,
                                          const DiagnosisContext& context) {
  if (sessions.size() == 1) return Compare(sessions[0], context);
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis diagnosis, CompareSessions(sessions, context));
  TellWhatWasSeen(sessions[0], &diagnosis);
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> Diagnose(const std::vector<DiagnosisInput>& sessions,
                                           const DiagnosisContext& context) {
  if (sessions.size() == 1) return Diagnose(sessions[0], context);
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis diagnosis, DiagnoseSessions(sessions, context));
  TellWhatWasSeen(sessions[0], &diagnosis);
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> Propose(const DiagnosisInput& input, int max_measurements,
                                          const DiagnosisContext& context) {
  if (input.images == nullptr) return ProposeTouches(input, max_measurements, context);
  if (input.set != nullptr)
    return absl::InvalidArgumentError("a plan is of one kind: propose touches or photographs, one by one");
  return ProposePhotographSet(input, max_measurements, context);
}

absl::StatusOr<report::Diagnosis> Check(const DiagnosisInput& input, const design::PlanQuestion& question,
                                        const DiagnosisContext& context) {
  return CheckTouchPlan(input, question, context);
}

absl::StatusOr<report::Diagnosis> Explain(const DiagnosisInput& input, const std::string& effect,
                                          const DiagnosisContext& context) {
  return ExplainTouches(input, effect, context);
}

absl::StatusOr<report::Diagnosis> Uncertainty(const DiagnosisInput& input,
                                              const uncertainty::Posterior& posterior,
                                              const DiagnosisContext& context) {
  return UncertaintyOfPlan(input, posterior, context);
}

}  // namespace touchstone::diagnosis
