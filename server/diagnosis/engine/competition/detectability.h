// What an experiment can find, whatever it will measure: for each effect that a model lacks, the size from which a search
// finds it and the size from which it is told from the effect that resembles it most. The rows are taken as they are
// expected, not drawn: inner products of what an effect adds, plus those of the noise.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// One value of an effect that the model lacks; the effect's other values change nothing unless the value acts with them
// only. Sizes are distances from the value that changes nothing, in the unit of files; of a value that acts by its
// inverse (ParameterInfo::reciprocal) they are the value itself, and a larger one changes less.
struct DetectableValue {
  std::shared_ptr<const model::Effect> effect;
  int parameter = 0;  // of the effect
  std::string entry;  // EntryName
  // What a fit leaves open about the value: at the smallest size that is found, else at the typical one. 0: the rows do not
  // depend on the value.
  double std_error = 0;
  double typical = 0;  // what rigs show, within the bounds
  double power_at_typical = 0;
  // None: no size within the bounds and twenty times what rigs show, or the value does not act by itself.
  std::optional<double> found_from;
  // What would explain most of the effect at that size: an effect, "given:NAME", or empty. `correlation`: of the two
  // responses, 0 to 1.
  std::string rival;
  double correlation = 0;
  std::optional<double> told_from;  // at least found_from
  // The model with the effect at found_from (else at the typical size), and with the rival in its place as it would be
  // fitted; null: there is none.
  std::shared_ptr<const model::Model> with_effect, with_rival;
};

// What is asked: every effect beside its nearest rival, or one effect (by name) and one rival.
struct DetectionQuestion {
  std::string effect, rival;  // empty: all, the nearest
};

// `given`: the model, evaluated where it stands or fitted, at which `search` would look for the next step; its effects
// before `initial_effects` are the model's own. `sigma`: noise of one row (> 0). Values of effects that do not act on all
// objects alike take part as rivals only. In the order of the search's candidates. Errors as FitModel.
//
// The gain of a search is taken as noncentral chi-squared in twice the log likelihood; the thresholds are those of
// SearchRules.
absl::StatusOr<std::vector<DetectableValue>> FindDetectable(const StepwiseSearch& search, const Fit& given,
                                                            int initial_effects, double sigma,
                                                            const DetectionQuestion& question = {});

}  // namespace touchstone::diagnosis::engine
