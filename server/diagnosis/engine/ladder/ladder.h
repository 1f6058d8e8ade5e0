// What a diagnosis makes of the model that it was given, whatever was measured: other values, steps, how sure of them, a
// verdict.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/ladder/hypotheses.h"

namespace touchstone::diagnosis::engine {

struct Improvement {
  Verdict verdict = Verdict::kNone;      // a comparison leaves it kNone
  std::vector<RefittedEffect> refitted;  // values of the given model's effects that must change
  std::vector<std::string> superfluous;  // its effects that the data do without
  std::vector<LadderStep> steps;         // in the order in which they explain most
  std::vector<ConfoundedEffects> confounded;
  std::vector<RankedCandidate> candidates;  // best first
  std::optional<UnexplainedRest> unexplained;

  model::Model improved;      // the given model with steps and refits, without what has no name
  bool changed = false;       // improved differs from the given model
  bool values_wrong = false;  // an effect of the given model, other than noise, has other values
};

// The values of a fit as the improved model, and what became of the given model's effects: new values, or zero as far as the
// data can tell. `selected`: the fit to the search's rows; `values`: the fit that values are taken from,
// of the same effects. Returns the indices of the superfluous ones, largest first.
absl::StatusOr<std::vector<int>> ImproveValues(const Experiment& experiment, const Fit& selected,
                                               const Fit& values, const Eigen::MatrixXd& covariance,
                                               const model::Model& given,
                                               const std::vector<std::string>& objects,
                                               Improvement* improvement);

// Where no step was found, new values that compare worse are none: the given model stays. Returns whether it does.
bool KeepGivenIfWorse(const model::Model& given, const Quality& initial, const Quality& final,
                      Improvement* improvement);

// A step of the explanation, and what it cannot be told from. `model`: with it, all earlier ones and refits, of this quality.
LadderStep& AddStep(const Fit& values, const Eigen::MatrixXd& covariance, const SelectedStep& from,
                    const model::Model& model, const Quality& quality, Improvement* improvement);

// A step that changes no expectation: a kind of noise, in the improved model too. `values`: SI.
LadderStep& AddNoiseStep(const std::shared_ptr<const model::Effect>& effect, std::vector<double> values,
                         std::vector<ParameterEstimate> estimates, double probability, const Quality& quality,
                         Improvement* improvement);

// The verdict on a model by what was found: whether something is left without a name, steps, other values.
Verdict VerdictOf(bool rest, bool steps, bool values_wrong);

// How sure of the steps beside what was found, the verdict, and the improved model's name. `explained_share`: of the
// mean square error that is no noise, what the improved model takes away: the rest may be a part of what steps stand in for.
void Conclude(const Hypotheses& found, double explained_share, Improvement* improvement);

// Adds the step's effect and its equivalents to those that these data cannot tell apart, if there are any.
void AddConfounded(const LadderStep& step, std::vector<ConfoundedEffects>* confounded);

// Of the mean square error beyond the noise, what an explanation takes away: 0 to 1.
double ExplainedShare(double rmse_before, double rmse_after, double noise);

// A sentence more about a step.
void AddWords(const std::string& words, LadderStep* step);

// What the catalogue says of an effect, for people.
void AddTexts(const model::Effect& effect, LadderStep* step);

// The effect as it stands in a model file: "- lookup: ...". Of `model` only the rig counts.
std::string EffectYaml(model::Model model, model::EffectInstance instance);

// A value that a person can read: three more digits than the standard error leaves uncertain.
double RoundedTo(double value, double std_error);

// Sets the fitted values of a model, rounded so.
void RoundValues(const Fit& fit, model::Model* model);

}  // namespace touchstone::diagnosis::engine
