// From an explanation to its description: what the steps say, values of the given model that changed, how far a step is to be trusted beside a rest.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/result.h"

namespace touchstone::diagnosis::engine {

// Everything but the error and the model. `values`: the fit that its values are taken from, of the same effects as the one
// that was selected.
LadderStep DescribeStep(const Fit& values, const Eigen::MatrixXd& covariance, const SelectedStep& from);

// Adds the step's effect and its equivalents to those that these data cannot tell apart, if there are any.
void AddConfounded(const LadderStep& step, std::vector<ConfoundedEffects>* confounded);

// What became of the given model's effects that were set free.
struct GivenEffects {
  std::vector<RefittedEffect> refitted;  // in the model's order
  std::vector<int>
      superfluous;  // indices, largest first: zero as far as the data can tell, and no worse without
  std::vector<std::string> superfluous_names;

  bool changed() const { return !refitted.empty() || !superfluous.empty(); }
};
// `selected`: the fit to the search's rows; `values`: see DescribeStep.
absl::StatusOr<GivenEffects> DescribeGivenEffects(const Experiment& experiment, const Fit& selected,
                                                  const Fit& values, const Eigen::MatrixXd& covariance,
                                                  const model::Model& given,
                                                  const std::vector<std::string>& objects);

// Of the mean square error beyond the noise, what an explanation takes away: 0 to 1.
double ExplainedShare(double rmse_before, double rmse_after, double noise);

// The most that a step can be sure of where a rest remains unexplained: it may be a part of something else. `doubted`:
// something else speaks against the explanation.
double MostBesideRest(double explained_share, bool doubted);
// Lowers the probabilities of steps and candidates to that, and says so of the steps.
void DoubtBesideRest(double most, std::vector<LadderStep>* steps, std::vector<RankedCandidate>* candidates);

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
