// The values of a model in every session, with the verdict whether they changed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/joint/between_sessions.h"
#include "server/diagnosis/joint/session_choice.h"

namespace touchstone::diagnosis::joint {

// What is said of a value, and all that is said of it: where it lies outside its limits and how much it scatters follow the
// verdict (SetVerdict).
enum class ValueChange {
  kUnchanged,  // the 95 % interval holds no change that would move the rows by more than their noise; no session is outside
  kChanged,
  kCannotSay,  // all else
};

// Sessions one after the other that agree on a value within kRunErrors standard errors, and their mean.
struct SessionRun {
  std::vector<int> sessions;
  SessionEstimate mean;
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
  // By session, of four or more that measure it: what the others let expect of it.
  std::vector<std::optional<ControlLimits>> limits;
  // Of a value that changed: the standard deviation between three sessions or more that are within their limits, beyond the
  // standard errors, and where it changed. Of all others 0 and empty.
  double scatter = 0;
  std::vector<SessionRun> runs;
};

// Decides what is said of a value from its values in the sessions, which are set. `apart`: the data speak for values of its
// own in each session; `steady`: no difference in its interval would move rows by more than their noise.
void SetVerdict(bool apart, bool steady, ComparedValue* value);

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
