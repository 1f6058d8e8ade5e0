// The values of a model in every session, with the verdict whether they changed.
#pragma once

#include <optional>
#include <string>
#include <vector>

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

// One group of the evidence, described where each session has its own values of it and all else is as chosen.
ComparedEffect DescribeGroup(const SessionEvidence& evidence, const SessionChoice& choice, int group);

}  // namespace touchstone::diagnosis::joint
