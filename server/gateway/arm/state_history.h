// The states of the last rig seconds, in bounded memory. Not thread-safe.
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway::arm {

class StateHistory {
 public:
  StateHistory(double keep_s, size_t most) : keep_s_(keep_s), max_(most) {}

  // A state whose time lies before the newest one means that the clock was set back: the history begins anew.
  void Add(const ArmState& state);
  std::vector<ArmState> Between(double from_controller_s, double to_controller_s) const;
  const ArmState* newest() const { return states_.empty() ? nullptr : &states_.back(); }
  double RateHz() const;  // states in a controller's second, over the last one; 0: too few
  void Clear() { states_.clear(); }

 private:
  double keep_s_;
  size_t max_;
  std::deque<ArmState> states_;
};

}  // namespace touchstone::gateway::arm
