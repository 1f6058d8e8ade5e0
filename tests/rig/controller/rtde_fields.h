// The variables of RTDE: their types and how they are written and read.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "tests/rig/controller/machine.h"
#include "tests/rig/controller/wire.h"

namespace touchstone::rig {

struct RtdeOutput {
  std::string type;  // "DOUBLE", "VECTOR6D" ...
  std::function<void(const RobotState& state, WireWriter* to)> write;
};

struct RtdeInput {
  std::string type;
  size_t bytes;
  std::function<void(Machine* machine, WireReader* from)> read;
};

// By name. A few currents, voltages and temperatures are constants: nothing of this rig depends on them.
const std::map<std::string, RtdeOutput>& RtdeOutputs();
const std::map<std::string, RtdeInput>& RtdeInputs();

}  // namespace touchstone::rig
