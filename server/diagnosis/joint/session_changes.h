// What sessions of one kind of measurement have in common, and what changed between them. A value is one for all sessions
// unless the sessions' data speak for values of their own; an effect that any session shows is looked for in all of them.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/joint/session_choice.h"

namespace touchstone::diagnosis::joint {

enum class ValueChange {
  kUnchanged,  // the 95 % interval holds no change that would move the rows by more than their noise
  kChanged,
  kCannotSay,  // it holds such changes, and no change at all
};

// One entry of a parameter in every session, in the unit of files.
struct ComparedValue {
  ValueChange change = ValueChange::kCannotSay;
  // As the session has it, beside all else; none: the session does not measure it.
  std::vector<std::optional<engine::ParameterEstimate>> by_session;
  // The sessions that differ most, over the standard error of the difference, the earlier one first; and the later one's value
  // less the earlier one's, with its 95 % interval.
  int from = 0, to = 0;
  double difference = 0, std_error = 0, lower = 0, upper = 0;
};

struct ComparedEffect {
  std::string effect, object;  // object: of values that differ by object; empty: of all
  bool given = false;          // of the given model
  SessionValues values = SessionValues::kShared;
  double p = 1;          // of sessions that differ so much by chance, over all effects that are compared
  double gain_nats = 0;  // of log evidence, of values for each session over one for all
  // Effects whose change explains the sessions as well; with kOwn.
  std::vector<std::string> equivalent;
  std::vector<ComparedValue> entries;
};

// An effect that the given model lacks and the sessions show.
struct SessionStep {
  std::string effect;
  double gain_nats = 0;    // over the explanation without it
  double probability = 0;  // of the session that is surest of it by itself
  std::vector<std::string> equivalent;  // effects that no session tells from it
  std::vector<engine::ParameterEstimate> parameters;  // with the session's index where it has values of its own
  std::vector<model::Model> models;     // by session: the given model with it and all earlier steps
};

struct SessionChanges {
  std::vector<ComparedEffect> effects;  // of the given model first
  std::vector<SessionStep> steps;       // in the order in which they explain most
  std::vector<engine::RefittedEffect> refitted;  // values of the given model that all sessions want otherwise
  std::vector<model::Model> models;     // by session
  std::vector<engine::HeldOutError> heldout;  // by session, of its model
  bool moved() const { return !steps.empty() || !refitted.empty() || changed(); }
  bool changed() const;
};

// `sessions`: at least two of one kind, each with enough data for a verdict, that were searched with the same model.
// `progress` is told how much is done, 0 to 1, and answers false to cancel. Errors: CANCELLED, or what a simulator says.
absl::StatusOr<SessionChanges> FindSessionChanges(const std::vector<const engine::Modality*>& sessions,
                                                  const std::function<bool(double done)>& progress);

}  // namespace touchstone::diagnosis::joint
