// The emulator's control port: a line in, a line out. "ok ..." or "error ...".
#pragma once

#include <functional>
#include <string>

#include "tests/rig/emulator.h"
#include "tests/rig/world/fingers.h"

namespace touchstone::rig {

inline constexpr char kCommands[] =
    "mount OBJECT [FACE] | unmount | fault NAME VALUE | faults | truth [NUMBER] | count [WHAT] | press "
    "| release | "
    "reset | session | ports | help | quit";

// What the commands need besides the emulator itself.
struct CommandHooks {
  std::function<void()> restart_session, quit;
  std::function<std::string()> ports;  // emulator.json, one line
};
std::string AnswerCommand(const std::string& line, Emulator* emulator, const CommandHooks& hooks);

// One touch as JSON; null where a finger made no contact or reported none.
std::string TruthJson(const TouchTruth& truth);

}  // namespace touchstone::rig
