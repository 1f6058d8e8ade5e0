#include "server/diagnosis/joint/session_choice.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {}  // namespace

SessionStates WithState(SessionStates states, int group, SessionValues state) {
  states[group] = state;
  return states;
}

SessionChoice::SessionChoice(const SessionEvidence& evidence) : evidence_(evidence) {
  for (int g = 0; g < groups(); ++g) {
    states_.push_back(IsCompared(g) ? SessionValues::kOwn : SessionValues::kShared);
    compared_ += IsCompared(g);
  }
  chosen_ = evidence_.Of(states_);
  for (int moves = 0; moves < kJointRules.max_moves && (MakeFewer() || MakeMore() || Swap()); ++moves) {
  }
}

double SessionChoice::PApart(const SharedEvidence& one, const SharedEvidence& apart) const {
  const int more = apart.free - one.free;
  if (more <= 0) return 1;
  const double p =
      FisherTail(std::max(0.0, one.squares - apart.squares) / more, more, evidence_.DegreesUnder(apart));
  return std::min(1.0, p * compared_);
}

bool SessionChoice::IsApart(const SharedEvidence& one, const SharedEvidence& apart) const {
  return PApart(one, apart) <= kJointRules.changed_p &&
         apart.log_evidence - one.log_evidence >= kJointRules.changed_nats;
}

// Takes the values that are needed least: one for all sessions in the place of each session's, the given ones in the place of
// that.
bool SessionChoice::MakeFewer() {
  std::optional<Move> best;
  double best_lack = 0;
  for (int g = 0; g < groups(); ++g) {
    if (states_[g] == SessionValues::kGiven) continue;
    const bool own = states_[g] == SessionValues::kOwn;
    Move move{WithState(states_, g, own ? SessionValues::kShared : SessionValues::kGiven), {}};
    move.evidence = evidence_.Of(move.states);
    const double least = own ? kJointRules.changed_nats.value() : evidence_.groups()[g].least_nats;
    const double gain = chosen_.log_evidence - move.evidence.log_evidence;
    if (own ? IsApart(move.evidence, chosen_) : gain >= least) continue;
    if (best && least - gain <= best_lack) continue;
    best_lack = least - gain;
    best = std::move(move);
  }
  if (best) Take(*std::move(best));
  return best.has_value();
}

// Values of their own where all the rest, as it is by now, speaks for them.
bool SessionChoice::MakeMore() {
  std::optional<Move> best;
  for (int g = 0; g < groups(); ++g) {
    if (!IsCompared(g) || states_[g] == SessionValues::kOwn) continue;
    const SharedEvidence one = evidence_.Of(WithState(states_, g, SessionValues::kShared));
    Move move{WithState(states_, g, SessionValues::kOwn), {}};
    move.evidence = evidence_.Of(move.states);
    const double least = states_[g] == SessionValues::kGiven ? evidence_.groups()[g].least_nats : 0;
    if (!IsApart(one, move.evidence) || move.evidence.log_evidence - chosen_.log_evidence < least ||
        (best && move.evidence.log_evidence <= best->evidence.log_evidence))
      continue;
    best = std::move(move);
  }
  if (best) Take(*std::move(best));
  return best.has_value();
}

// A change of one effect in the place of another's.
bool SessionChoice::Swap() {
  for (int g = 0; g < groups(); ++g) {
    if (states_[g] != SessionValues::kOwn) continue;
    const SessionStates without = WithState(states_, g, SessionValues::kShared);
    for (int h = 0; h < groups(); ++h) {
      if (!IsCompared(h) || states_[h] == SessionValues::kOwn) continue;
      Move move{WithState(without, h, SessionValues::kOwn), {}};
      move.evidence = evidence_.Of(move.states);
      if (move.evidence.log_evidence <= chosen_.log_evidence + kJointRules.changed_nats) continue;
      Take(std::move(move));
      return true;
    }
  }
  return false;
}

std::vector<std::string> SessionChoice::EquivalentChanges(int group) const {
  std::vector<std::string> names;
  const SessionStates without = WithState(states_, group, SessionValues::kShared);
  const std::string& own = evidence_.groups()[group].effect;
  for (int h = 0; h < groups(); ++h) {
    const std::string& name = evidence_.groups()[h].effect;
    if (name == own || !IsCompared(h) || states_[h] == SessionValues::kOwn) continue;
    const double log_evidence = evidence_.Of(WithState(without, h, SessionValues::kOwn)).log_evidence;
    if (log_evidence >= chosen_.log_evidence - engine::SearchRules().equivalent_nats &&
        std::find(names.begin(), names.end(), name) == names.end())
      names.push_back(name);
  }
  return names;
}

}  // namespace touchstone::diagnosis::joint
