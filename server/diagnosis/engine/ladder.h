// From an explanation to its description: the steps in the order in which they explain most, values of the given model that
// changed, how far a step is to be trusted beside a rest.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition.h"
#include "server/diagnosis/engine/result.h"

namespace touchstone::diagnosis::engine {

// A step, and the fit with it and all earlier ones.
struct OrderedStep {
  const SelectedStep* step = nullptr;
  Fit fit;
  bool whole = false;  // the fit is the whole explanation
};

// Each step is fitted with those before it; the last one's fit is the whole explanation, unless that holds an effect without
// a name (index `nameless`; -1: none). Effects in `at_end` come after all others, in that order. `steps` must outlive the
// result. Errors as FitModel.
absl::StatusOr<std::vector<OrderedStep>> OrderSteps(const Experiment& experiment, const Explanation& whole,
                                                    int nameless, const std::vector<SelectedStep>& steps,
                                                    const std::vector<int>& at_end);

// The first step with which the error of the fit, or on parts that it did not see, does not fall: no step; -1: each is
// one. `before`: of the given model; `after`: of the model with each step and all earlier ones.
int StepWithoutGain(const Quality& before, const std::vector<Quality>& after);
// Which effects come last in the order of steps. A step with which the error does not fall may need one that comes after it:
// before it is taken out it is tried at the end, on top of all others.
class StepsAtEnd {
 public:
  const std::vector<int>& effects() const { return effects_; }
  // Whether `effect`, without gain in the order `climbed`, has a place at the end yet to be tried. Then it gets it.
  bool MoveToEnd(int effect, const std::vector<int>& climbed);
  // The effect has left the model: those behind it move up.
  void TakeOut(int effect);

 private:
  std::vector<int> effects_;
};

// The qualities of steps.
std::vector<Quality> QualitiesOf(const std::vector<LadderStep>& steps);

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
