// All that a diagnosis says, as plain values in SI (parameters in the units of files). write_report.h turns it into
// the wire message, summary.h into sentences.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/design/propose.h"
#include "server/diagnosis/distributions/pose_free.h"
#include "server/diagnosis/engine/result.h"
#include "server/diagnosis/residuals/describe_residuals.h"
#include "server/diagnosis/touches/data_summary.h"

namespace touchstone::diagnosis::report {

// What was compared as distributions, and how it came out.
struct PoseFreeDiagnosis {
  DiagnosisInput input;
  distributions::PoseFreeComparison comparison;
};

struct Diagnosis {
  engine::Verdict verdict = engine::Verdict::kNone;
  std::string model_name, model_hash;  // of the initial model
  touches::DataSummary data;

  // How wrong; none of them if no touch could be used.
  std::optional<engine::NoiseFloor> noise_floor;
  std::optional<engine::Quality> initial;  // the model as it was given
  std::optional<engine::Quality> final;    // after all steps and refits
  double reducible_share = 0;              // of the mean square error that is not noise, 0 to 1

  // Where.
  residuals::ResidualSummary residuals;

  // Why, and what to do.
  std::vector<engine::RefittedEffect> refitted;
  std::vector<engine::LadderStep> steps;
  std::vector<engine::ConfoundedEffects> confounded;
  std::vector<engine::RankedCandidate> candidates;
  std::optional<engine::UnexplainedRest> unexplained;
  std::vector<std::string> superfluous;                  // effects of the model that the data do without
  std::vector<engine::DataProblem> data_problems;        // with kCheckData; no step is claimed beside them
  int touches_needed = 0;                                // with kTooLittleData
  std::string improved_model_yaml, improved_model_hash;  // empty if nothing changed
  std::vector<design::ProposedTouch> next_touches;

  std::string summary;                // one paragraph
  std::vector<std::string> warnings;  // what limits all this
  double duration_s = 0;

  std::optional<PoseFreeDiagnosis> pose_free;  // of a set without poses, instead of all the rest
};

}  // namespace touchstone::diagnosis::report
