// The realtime interface (30003): one packet of fixed layout every cycle.
#pragma once

#include <string>

#include "tests/rig/controller/machine/machine.h"

namespace touchstone::rig {

// "RealTime 5.10" of UR's "Realtime Client Interface" (docs.universal-robots.com, realtime-guide): 1220 bytes, the
// size first, big-endian doubles behind it. The e-Series controller here is 5.11. UR publishes no table for CB3
// 3.15.8, whose other interfaces got the same fields at the same time (3.15 / 5.11): it sends the same.
std::string RealtimePacket(const RobotState& state);

}  // namespace touchstone::rig
