// What sessions of one kind of measurement have in common, and what changed between them. A value is one for all sessions
// unless the sessions' data speak for values of their own; an effect that any session shows is looked for in all of them.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/joint/compared_values.h"

namespace touchstone::diagnosis::joint {

// An effect that the given model lacks and the sessions show.
struct SessionStep {
  std::string effect;
  double gain_nats = 0;                 // over the explanation without it
  double probability = 0;               // of the session that is surest of it by itself
  std::vector<std::string> equivalent;  // effects that no session tells from it
  std::vector<engine::ParameterEstimate>
      parameters;                    // with the session's index where it has values of its own
  std::vector<model::Model> models;  // by session: the given model with it and all earlier steps
};

struct SessionChanges {
  std::vector<ComparedEffect> effects;           // of the given model first
  std::vector<SessionStep> steps;                // in the order in which they explain most
  std::vector<engine::RefittedEffect> refitted;  // values of the given model that all sessions want otherwise
  std::vector<model::Model> models;              // by session
  std::vector<engine::HeldOutError> heldout;     // by session, of its model
  bool moved() const { return !steps.empty() || !refitted.empty() || changed(); }
  bool changed() const;
};

// By session, the effects that its own diagnosis claims; empty: all that its search added.
using ClaimedEffects = std::vector<std::set<std::string>>;

// `sessions`: at least two of one kind, each with enough data for a verdict, that were searched with the same model. An effect
// that no session claims is not compared. `progress` is told how much is done, 0 to 1, and answers false to cancel. Errors:
// CANCELLED, or what a simulator says.
absl::StatusOr<SessionChanges> FindSessionChanges(const std::vector<const engine::Modality*>& sessions,
                                                  const ClaimedEffects& claimed,
                                                  const std::function<bool(double done)>& progress);

}  // namespace touchstone::diagnosis::joint
