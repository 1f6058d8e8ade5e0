#include "server/gateway/timing/change_notifier.h"

namespace touchstone {

double HostNowS() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace touchstone
