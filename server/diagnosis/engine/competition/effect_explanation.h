// Why one effect is, or is not, what a model lacks.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// Another effect that explains part of what the one in question does.
struct TakenOver {
  std::string effect;    // "given:NAME": a value of the model's own
  double share = 0;      // of the squares of the effect's response, 0 to 1
  double gain_nats = 0;  // of the other alone, to first order
};

struct EffectExplanation {
  std::string effect;
  bool in_model = false;   // its values there were fitted anew
  bool visible = true;     // false: the rows do not depend on it
  bool changes = true;     // false: it fits best where it changes nothing
  std::optional<Fit> fit;  // with the effect; none where it is not visible
  std::vector<ParameterEstimate> parameters;
  double gain_nats = 0;
  double probability = 0;  // of being the one effect that is missing, among all candidates and nothing
  double needed_nats = 0;  // that a search asks for
  std::vector<TakenOver> taken_over;  // largest share first
};

// `initial`: a fit of the given model, whose effects come before `initial_effects`. Error: NOT_FOUND for what is no
// candidate of the search and no systematic effect of the model; else as FitModel.
absl::StatusOr<EffectExplanation> ExplainEffect(const StepwiseSearch& search, const Fit& initial,
                                                int initial_effects, const std::string& effect);

}  // namespace touchstone::diagnosis::engine
