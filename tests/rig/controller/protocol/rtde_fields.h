// The variables of RTDE: their types and how they are written and read.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "tests/rig/controller/machine/machine.h"
#include "tests/rig/controller/network/wire.h"

namespace touchstone::rig {

struct RtdeOutput {
  std::string type;  // "DOUBLE", "VECTOR6D" ...
  std::function<void(const RobotState& state, WireWriter* to)> write;
  bool e_series_only = false;
};

struct RtdeInput {
  std::string type;
  size_t bytes;
  std::function<void(Machine* machine, WireReader* from)> read;
};

// By name: UR's table ("Real-Time Data Exchange (RTDE) guide", article 22229, with the versions that introduced them) as
// far as controllers 5.11 and 3.15.8 have it. What came later (collision_detection_ratio, time_scale_source, ...) is not
// found. A few currents, voltages and temperatures are constants: nothing of this rig depends on them.
const std::map<std::string, RtdeOutput>& RtdeOutputs();
const std::map<std::string, RtdeInput>& RtdeInputs();

}  // namespace touchstone::rig
