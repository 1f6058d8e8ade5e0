// A hardware counter of 24 or 32 bits made into one of 64 that never wraps.
#pragma once

#include <cstdint>

namespace touchstone::firmware {

// Extends readings of a counter that wraps at 2^bits. Readings may come out of order by less than half a
// turn: an edge that the hardware captured is read after a later "now".
class TickExtender {
 public:
  explicit TickExtender(unsigned bits = 32) : bits_(bits) {}
  // Ticks since the first turn began, the one of the first reading. Must be called at least once every half
  // turn. What was captured before that turn began is 0.
  uint64_t Extend(uint32_t reading);

 private:
  unsigned bits_;
  uint64_t last_ = 0;  // the latest
  bool started_ = false;
};

}  // namespace touchstone::firmware
