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
// data can tell. `selected`, `values`: see DescribeGivenEffects. Returns the indices of the superfluous ones, largest first.
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

// How sure of the steps beside what was found, the verdict, and the improved model's name. `explained_share`: see
// MostBesideRest.
void Conclude(const Hypotheses& found, double explained_share, Improvement* improvement);

}  // namespace touchstone::diagnosis::engine
