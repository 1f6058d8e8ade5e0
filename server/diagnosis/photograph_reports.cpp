#include "server/diagnosis/photograph_reports.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/checks/photographs/photo_mistakes.h"
#include "server/diagnosis/design/propose_photographs.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/report/kinds/from_photographs.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/diagnosis/residuals/photographs/describe_photographs.h"
#include "server/diagnosis/rules.h"

namespace touchstone::diagnosis {
namespace {

using Engine = std::function<absl::StatusOr<images::PhotographDiagnosis>(images::Expectation*)>;

// What a comparison finds for this model on this set.
double GreyErrorOf(const DiagnosisInput& input, ThreadPool* pool) {
  const absl::StatusOr<images::Photographs> photographs = images::MakePhotographs(input, pool);
  if (!photographs.ok()) return NAN;
  const absl::StatusOr<std::vector<image::Photo>> expected =
      images::ExpectPhotographs(*photographs, *input.model, false, pool);
  return expected.ok() ? images::RmseGrey(*photographs, *expected) : NAN;
}

// The problem with its errors: the model as it was given, on the set as it is and as it would be.
engine::DataProblem WithErrors(const checks::PhotoMistake& mistake, const DiagnosisInput& input,
                               double before_grey, ThreadPool* pool) {
  engine::DataProblem problem = mistake.problem;
  problem.error_before = before_grey;
  DiagnosisInput fixed = input;
  if (mistake.model != nullptr) {
    fixed.model = mistake.model;
  } else {
    auto set = std::make_shared<session::ImageSet>(*input.images);
    if (!session::ApplyFix(mistake.fix, set.get()).ok()) return problem;
    fixed.images = set;
  }
  problem.error_after = GreyErrorOf(fixed, pool);
  if (std::abs(problem.error_after - before_grey) > 1e-9)
    problem.words += absl::StrFormat(" The model as it is would be off by %.3g grey levels instead of %.3g.",
                                     problem.error_after, before_grey);
  return problem;
}

// Single pictures that seem to show something else, although most of the error is in all others too: physics that acts in
// some pictures more than in others (a cast shadow) looks like that.
bool IsOfAllPictures(const checks::PhotoMistake& mistake, const DiagnosisInput& input, ThreadPool* pool) {
  if (mistake.problem.kind != engine::ProblemKind::kOddPicture) return false;
  const double before_grey = GreyErrorOf(input, pool);
  return !(WithErrors(mistake, input, before_grey, pool).error_after <
           kDiagnosisRules.max_left_by_others * before_grey);
}

absl::StatusOr<report::Diagnosis> Reported(const DiagnosisInput& input, const DiagnosisContext& context,
                                           const Engine& engine) {
  images::Expectation expectation;
  TOUCHSTONE_ASSIGN_OR_RETURN(images::PhotographDiagnosis found, engine(&expectation));
  if (context.progress) context.progress("describing what is left", 0.95);
  return DescribedPhotographs(input, context, expectation, &found);
}

// Diagnose, and the pictures that would tell what is left apart. `always`: Propose, which names pictures even where
// nothing is confounded.
absl::StatusOr<images::PhotographDiagnosis> DiagnosedWithNext(const DiagnosisInput& input,
                                                              int max_photographs, bool always,
                                                              const DiagnosisContext& context,
                                                              images::Expectation* expectation) {
  TOUCHSTONE_ASSIGN_OR_RETURN(images::PhotographDiagnosis diagnosis,
                              images::DiagnosePhotographs(input, context, expectation));
  const images::ExplanationsLeft& left = expectation->left;
  if (diagnosis.verdict == engine::Verdict::kTooLittleData) {
    const int missing = std::max(diagnosis.images_needed - expectation->photographs.poses, 1);
    diagnosis.next_photographs =
        design::PhotographsToBegin(expectation->photographs, always ? max_photographs : missing, input.seed);
    return diagnosis;
  }
  if (!always && !left.confounded) return diagnosis;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("choosing pictures", 0.9));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      diagnosis.next_photographs,
      design::ProposePhotographs(expectation->photographs, left, max_photographs, input.seed, context.pool));
  if (!always || !diagnosis.next_photographs.empty()) return diagnosis;
  if (left.models.size() < 2) {
    diagnosis.warnings.push_back("No picture would tell more than those at hand.");
    return diagnosis;
  }
  const std::string other = engine::DiscriminatingMeasurement({left.models[0].name, left.models[1].name});
  diagnosis.warnings.push_back(absl::StrCat("No picture of this camera tells ", left.models[0].name, " from ",
                                            left.models[1].name, other.empty() ? "." : ": ", other));
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> DataErrorsFirst(const DiagnosisInput& input,
                                                  const DiagnosisContext& context, const Engine& engine) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<report::Diagnosis> data_errors,
                              PhotographDataErrors(input, context));
  if (data_errors) return *std::move(data_errors);
  return Reported(input, context, engine);
}

}  // namespace

report::Diagnosis DescribedPhotographs(const DiagnosisInput& input, const DiagnosisContext& context,
                                       const images::Expectation& expectation,
                                       images::PhotographDiagnosis* found) {
  residuals::DescribePhotographs(expectation, input.seed, context.pool, found);
  report::Diagnosis diagnosis = report::FromPhotographs(*found, *input.images);
  report::SetCopiesAside(expectation.photographs.copies, &diagnosis);
  for (std::string& warning : report::DataWarnings(diagnosis.data[0]))
    diagnosis.warnings.push_back(std::move(warning));
  diagnosis.summary = report::Summarize(diagnosis);
  return diagnosis;
}

absl::StatusOr<std::optional<report::Diagnosis>> PhotographDataErrors(const DiagnosisInput& input,
                                                                      const DiagnosisContext& context) {
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("checking the data", 0.02));
  std::vector<checks::PhotoMistake> mistakes = checks::FindPhotoMistakes(input, context);
  mistakes.erase(
      std::remove_if(mistakes.begin(), mistakes.end(),
                     [&](const auto& mistake) { return IsOfAllPictures(mistake, input, context.pool); }),
      mistakes.end());
  if (mistakes.empty()) return std::optional<report::Diagnosis>();
  const auto engine = [&](images::Expectation* expectation) -> absl::StatusOr<images::PhotographDiagnosis> {
    TOUCHSTONE_ASSIGN_OR_RETURN(images::PhotographDiagnosis diagnosis,
                                images::ComparePhotographs(input, context, expectation));
    diagnosis.verdict = engine::Verdict::kCheckData;
    diagnosis.final = diagnosis.initial;  // the model stays as it was given
    for (const checks::PhotoMistake& mistake : mistakes)
      diagnosis.data_problems.push_back(
          WithErrors(mistake, input, diagnosis.initial ? diagnosis.initial->rmse : NAN, context.pool));
    return diagnosis;
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis diagnosis, Reported(input, context, engine));
  return std::optional<report::Diagnosis>(std::move(diagnosis));
}

absl::StatusOr<report::Diagnosis> ComparePhotographSet(const DiagnosisInput& input,
                                                       const DiagnosisContext& context) {
  return Reported(input, context, [&](images::Expectation* expectation) {
    return images::ComparePhotographs(input, context, expectation);
  });
}

absl::StatusOr<report::Diagnosis> DiagnosePhotographSet(const DiagnosisInput& input,
                                                        const DiagnosisContext& context) {
  return DataErrorsFirst(input, context, [&](images::Expectation* expectation) {
    return DiagnosedWithNext(input, kDiagnosisRules.default_photographs, false, context, expectation);
  });
}

absl::StatusOr<report::Diagnosis> ProposePhotographSet(const DiagnosisInput& input, int max_photographs,
                                                       const DiagnosisContext& context) {
  return DataErrorsFirst(input, context, [&](images::Expectation* expectation) {
    return DiagnosedWithNext(input, max_photographs, true, context, expectation);
  });
}

}  // namespace touchstone::diagnosis
