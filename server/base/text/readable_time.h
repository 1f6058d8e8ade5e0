// Times as people read them.
#pragma once

#include <string>

namespace touchstone {

// The unit in which a person reads a time: us below 1 ms, ms below 1 s, else s. A time that three figures
// would round up to 1 ms or 1 s already has the larger unit.
struct TimeUnit {
  double per_us;       // of this unit in one microsecond: 1, 1e-3 or 1e-6
  const char* symbol;  // "us", "ms" or "s"
};
TimeUnit UnitOfTime(double time_us);

// "9.1 ms", "410 us", "1.25 s": at most three figures, without trailing zeros, for sentences.
std::string TimeInWords(double time_s);

}  // namespace touchstone
