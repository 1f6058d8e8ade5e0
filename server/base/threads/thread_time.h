#pragma once

#include <time.h>

namespace touchstone {

// Processor time that the calling thread has taken, in seconds: unlike the clock's it does not grow while others run.
inline double ThreadTimeS() {
  timespec time;
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec + 1e-9 * time.tv_nsec;
}

}  // namespace touchstone
