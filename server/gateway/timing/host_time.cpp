#include "server/gateway/timing/host_time.h"

#include <chrono>

#include "server/base/clock.h"

namespace touchstone::gateway::timing {

double HostNowS() {
  return SteadyClock().NowS();
}

double UnixNowS() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace touchstone::gateway::timing
