#include "server/gateway/timing/host_time.h"

#include <chrono>

namespace touchstone::gateway::timing {

double HostNowS() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double UnixNowS() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace touchstone::gateway::timing
