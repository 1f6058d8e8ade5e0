#include "server/diagnosis/images/diagnose_photographs.h"

#include <chrono>
#include <set>

#include "server/base/status.h"
#include "server/diagnosis/images/photo_ladder.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/search/photo_quality.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {
namespace {

double SecondsNow() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// What every answer begins with: how wrong the given model is.
absl::StatusOr<PhotographDiagnosis> Begin(const DiagnosisInput& input, const DiagnosisContext& context,
                                          Expectation* expectation) {
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("reading", 0));
  TOUCHSTONE_ASSIGN_OR_RETURN(expectation->photographs, MakePhotographs(input, context.pool));
  const Photographs& photographs = expectation->photographs;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("predicting", 0.02));
  TOUCHSTONE_ASSIGN_OR_RETURN(expectation->before,
                              ExpectPhotographs(photographs, *input.model, true, context.pool));
  PhotographDiagnosis diagnosis;
  diagnosis.model_name = input.model->name;
  diagnosis.model_hash = input.model->Hash();
  diagnosis.images = photographs.size();
  diagnosis.objects = photographs.objects;
  diagnosis.noise_floor = NoiseFloorOfPhotographs(photographs, expectation->before, context.pool);
  diagnosis.initial = QualityOfPhotographs(photographs, expectation->before, 0, context.pool);
  AssessByPixels(photographs, diagnosis.noise_floor, &*diagnosis.initial);
  if (!diagnosis.noise_floor.from_repeats)
    diagnosis.warnings.push_back(
        "No picture was taken twice: the noise floor is an upper bound, from what neighbouring pixels differ "
        "by. "
        "Repeat a few pictures.");
  return diagnosis;
}

}  // namespace

absl::StatusOr<PhotographDiagnosis> ComparePhotographs(const DiagnosisInput& input,
                                                       const DiagnosisContext& context,
                                                       Expectation* expectation) {
  const double began = SecondsNow();
  Expectation own;
  if (expectation == nullptr) expectation = &own;
  TOUCHSTONE_ASSIGN_OR_RETURN(PhotographDiagnosis diagnosis, Begin(input, context, expectation));
  diagnosis.duration_s = SecondsNow() - began;
  return diagnosis;
}

absl::StatusOr<PhotographDiagnosis> DiagnosePhotographs(const DiagnosisInput& input,
                                                        const DiagnosisContext& context,
                                                        Expectation* expectation) {
  const double began = SecondsNow();
  Expectation own;
  if (expectation == nullptr) expectation = &own;
  TOUCHSTONE_ASSIGN_OR_RETURN(PhotographDiagnosis diagnosis, Begin(input, context, expectation));
  if (expectation->photographs.poses < kImageRules.min_poses) {
    diagnosis.verdict = engine::Verdict::kTooLittleData;
    diagnosis.images_needed = kImageRules.min_poses;
  } else {
    TOUCHSTONE_RETURN_IF_ERROR(context.Enter("fitting", 0.1));
    TOUCHSTONE_ASSIGN_OR_RETURN(const PhotoSelection selection,
                                SelectPhotoExplanation(input, expectation->photographs, context));
    TOUCHSTONE_RETURN_IF_ERROR(context.Enter("describing", 0.85));
    expectation->left = FindExplanationsLeft(selection);
    TOUCHSTONE_RETURN_IF_ERROR(DescribeExplanation(input, context, expectation->photographs, selection,
                                                   expectation->before, &diagnosis, &expectation->after));
  }
  diagnosis.duration_s = SecondsNow() - began;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("done", 1));
  return diagnosis;
}

}  // namespace touchstone::diagnosis::images
