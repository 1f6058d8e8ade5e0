#include "firmware/core/ticks.h"

namespace touchstone::firmware {

uint64_t TickExtender::Extend(uint32_t reading) {
  const uint64_t turn = uint64_t{1} << bits_;
  const uint64_t mask = turn - 1;
  if (!started_) {
    started_ = true;
    last_ = reading & mask;
    return last_;
  }

  // Less than half a turn ahead is later, the rest is earlier: an edge that was captured before
  // the newest reading.
  const uint64_t ahead = (reading - last_) & mask;
  if (ahead < turn / 2) {
    last_ += ahead;
    return last_;
  }
  const uint64_t behind = turn - ahead;
  return behind <= last_ ? last_ - behind : 0;
}

}  // namespace touchstone::firmware
