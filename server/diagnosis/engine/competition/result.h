// What a diagnosis finds, as plain values: errors in the unit of the kind of measurement (seconds, grey levels, pixels),
// parameters in the units of files. report/ turns them into messages.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/fit/parameter_estimate.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::engine {

enum class Verdict {
  kNone,            // a comparison gives none
  kAdequate,        // as good as the data can tell
  kWrongValues,     // no effect is missing, values must change
  kMissingEffects,  // the steps bring the rest down to noise
  kUnexplained,     // a structure remains that no built-in effect explains
  kCheckData,       // a mistake in the file explains the error far better than physics can
  kTooLittleData,   // fewer touches than a verdict needs
};

enum class EffectScope { kRig, kObject };

struct Quality {
  double rmse = 0;           // as a comparison finds it
  double heldout_rmse = 0;   // the same on parts of the data that the fit did not see
  double lack_of_fit_p = 0;  // 0 to 1; of at least this misfit beyond the noise if nothing were missing
};

// The standard deviation that repeats of one measurement have among themselves: no model can go below it.
struct NoiseFloor {
  double sigma = 0;
  double lower = 0, upper = 0;  // 95 % interval; 0 if unknown
  double degrees_of_freedom = 0;
  double declared = 0;        // what the model says that it is; 0: it gives no one value
  bool is_rounding = false;   // sigma is what numbers of files are rounded to: what scatters is less
  bool from_repeats = false;  // false: an upper bound from the best model's residuals
  // The same without what changes slowly through the session, from neighbours in time (von Neumann); 0 without
  // repeats. Less than sigma where repeats share a course in time, which is not noise.
  double sigma_without_time = 0;
  double time_structure_z = 0;  // lag-1 autocorrelation of what repeats differ by, over its spread by chance
  double time_structure_p = 1;
};

// New values of an effect that the model has.
struct RefittedEffect {
  std::string effect;  // "formula NAME" for a formula
  std::vector<ParameterEstimate> parameters;
};

// An effect to add, after all earlier ones.
struct LadderStep {
  std::string effect;
  EffectScope scope = EffectScope::kRig;
  std::vector<std::string> equivalent;     // effects that these data cannot tell from this one
  std::string discriminating_measurement;  // that would tell; empty if nothing is confounded
  double probability = 0;                  // with its equivalents, among all that could take its place
  double gain_nats = 0;                    // of log evidence, over the fit without it
  std::vector<ParameterEstimate> parameters;
  Quality quality;     // with this step, all earlier ones and refits, everything fitted anew
  model::Model model;  // that has this quality
  std::string meaning, check_on_rig, remedy;  // for people, from the catalogue
  std::string words;  // where it acts, if not everywhere: "on lat10 only"; what limits the claim
};

enum class CandidateNote {
  kNone,
  kInvisible,   // this experiment cannot see it
  kNeutral,     // fits best where it changes nothing
  kAtBound,     // its best value lies at its bound
  kLinearised,  // not among the most probable: its gain is a linearised prediction
};

// One effect of the catalogue as the only step.
struct RankedCandidate {
  std::string effect;
  EffectScope scope = EffectScope::kRig;
  CandidateNote note = CandidateNote::kNone;
  double probability = 0;  // of being the one effect that is missing
  double gain_nats = 0;
  std::vector<ParameterEstimate> parameters;  // empty unless it was fitted
  double rmse = 0, heldout_rmse = 0;          // 0 unless it was fitted

  bool explains() const { return note != CandidateNote::kInvisible && note != CandidateNote::kNeutral; }
};

// Effects that these data cannot tell apart.
struct ConfoundedEffects {
  std::vector<std::string> effects;
  std::string discriminating_measurement;
};

struct CovariateTest {
  std::string name;
  double p = 1;  // corrected for the number of terms that were tried
  double gain_nats = 0;
};

// What no effect of the catalogue explains.
struct UnexplainedRest {
  std::vector<CovariateTest> covariates;  // that it depends on, largest gain first
  std::string formula;                    // a suggestion; empty: none
  std::string formula_yaml;               // the whole effect for a model file
  std::vector<ParameterEstimate> parameters;
  double rmse = 0, heldout_rmse = 0;  // with the formula: of `model_with`
  double heldout_gain = 0;            // share of the held-out excess error that it removes, 0 to 1
  std::string nearest_effect;         // of the catalogue, and the cosine between the two
  double nearest_cosine = 0;
  std::string
      words;  // what is known of it beside: "repeats with the pose, but not with the place"; may be empty
  std::string lookup_yaml;  // a curve in place of a formula, as a whole effect for a model file; empty: none
  std::shared_ptr<const model::Effect> lookup;  // the same curve; null: none
  // The improved model with the formula, or the curve, in its place among the effects, every value fitted beside it.
  std::optional<model::Model> model_with;
  std::string nearest_formula;       // the simple term that comes nearest to the curve; empty: none
  double nearest_formula_share = 0;  // of the curve's gain, 0 to 1
};

// In front of the others; in the place of one of the same name, whose figures it keeps.
void PutFirst(CovariateTest test, UnexplainedRest* rest);

// In the order of v1::DataProblem::Kind.
enum class ProblemKind {
  kFingerOrder,
  kLateralReversed,
  kApproachReversed,
  kObjectNames,
  kWrongMesh,
  kFrame,
  kUnitsTime,
  kUnitsLength,
  kSpeedFactor,
  kRowShift,
  kObjectOrigin,
  kDuplicates,
  kStaleRows,
  // Of photographs alone.
  kChannelOrder,
  kMirrored,
  kRotated,
  kUnitsAngle,
  kUpAxis,
  kEyeAt,
  kWrongObject,
  kFocalFactor,
  kExchanged,
  kOddPicture,
  // Of touches.
  kSaturatedTimes,
};

// A discrete mistake in a measurement file, and how to fix it.
struct DataProblem {
  ProblemKind kind = ProblemKind::kFingerOrder;
  std::string detail;  // "l <-> m"
  std::string words;   // a sentence for people, with the evidence
  std::string fix;     // the command that fixes the file; empty: none does
  double error_before = 0,
         error_after = 0;  // of the model as it was given, on the file as it is and would be
};

}  // namespace touchstone::diagnosis::engine
