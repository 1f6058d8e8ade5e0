// Which values sessions share: from values of its own in every session to as few as the data allow.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/joint/session_evidence.h"

namespace touchstone::diagnosis::joint {

using SessionStates = std::vector<SessionValues>;  // one per group of SessionEvidence

// The states with that of one group changed.
SessionStates WithState(SessionStates states, int group, SessionValues state);

class SessionChoice {
 public:
  // Searches. `evidence` must outlive it.
  explicit SessionChoice(const SessionEvidence& evidence);

  const SessionStates& states() const { return states_; }
  SessionValues state(int group) const { return states_[group]; }
  const SharedEvidence& chosen() const { return chosen_; }

  // Whether several sessions measure the group.
  bool IsCompared(int group) const { return evidence_.groups()[group].sessions.size() > 1; }
  // P of values that differ so much between sessions by chance, over all groups that are compared.
  double PApart(const SharedEvidence& one, const SharedEvidence& apart) const;
  // Effects whose change, in the place of that of `group`, explains as much.
  std::vector<std::string> EquivalentChanges(int group) const;

 private:
  struct Move {
    SessionStates states;
    SharedEvidence evidence;
  };
  bool IsApart(const SharedEvidence& one, const SharedEvidence& apart) const;
  bool MakeFewer();
  bool MakeMore();
  bool Swap();
  void Take(Move move) {
    states_ = std::move(move.states);
    chosen_ = std::move(move.evidence);
  }
  int groups() const { return static_cast<int>(evidence_.groups().size()); }

  const SessionEvidence& evidence_;
  SessionStates states_;
  SharedEvidence chosen_;
  double compared_ = 0;  // groups that several sessions measure
};

}  // namespace touchstone::diagnosis::joint
