#include "server/gateway/arm/state_history.h"

#include <algorithm>

namespace touchstone::gateway::arm {
namespace {

bool Before(const ArmState& state, double controller_s) {
  return state.controller_time_s < controller_s;
}

}  // namespace

void StateHistory::Add(const ArmState& state) {
  if (!states_.empty() && state.controller_time_s < states_.back().controller_time_s) states_.clear();
  states_.push_back(state);
  while (states_.size() > max_ || states_.front().controller_time_s < state.controller_time_s - keep_s_)
    states_.pop_front();
}

std::vector<ArmState> StateHistory::Between(double from_controller_s, double to_controller_s) const {
  const auto first = std::lower_bound(states_.begin(), states_.end(), from_controller_s, Before);
  auto last = first;
  while (last != states_.end() && last->controller_time_s <= to_controller_s) ++last;
  return std::vector<ArmState>(first, last);
}

double StateHistory::RateHz() const {
  if (states_.size() < 2) return 0;
  const double newest_s = states_.back().controller_time_s;
  const auto first = std::lower_bound(states_.begin(), states_.end(), newest_s - 1, Before);
  const double span_s = newest_s - first->controller_time_s;
  return span_s > 0 ? static_cast<double>(states_.end() - first - 1) / span_s : 0;
}

}  // namespace touchstone::gateway::arm
