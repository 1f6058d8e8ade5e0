// What the arm does without this gateway's having told it to, found in its states: the reasons for which the rig is
// latched.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway {

// Protective and emergency stops, violations, faults, recovery and safety modes that nobody knows latch whenever they are
// seen. A safeguard (a door, a light curtain, an enabling device that was let go) latches only if it interrupted a motion
// or one was asked for while it stood: UR's user manuals list it as used up to every cycle and with an automatic or manual
// reset, unlike the emergency stop, so a person may change the object between motions without a reset, but no program that
// retries moves the arm when the door closes.
//
// An arm that was seen running and then is not (power off at the pendant, a power cut, a controller that was started anew)
// latches too: it would start up unexpectedly (ISO 12100, 6.2.11.4; IEC 60204-1, 9.2.3.2). So does a program that is not
// this gateway's. Not thread-safe.
class ArmWatch {
 public:
  struct Doing {
    bool moving = false;    // a program of this gateway is under way
    bool powering = false;  // this gateway powers the arm up, and off again if that fails
    bool asked = false;     // somebody wants to move the arm now
  };

  // Looks at every state since the last call. Why the rig must be latched, in words for people ("PROTECTIVE_STOP between
  // motions"); empty: it need not be.
  std::vector<std::string> Look(const arm::Arm& arm, const Doing& doing);

 private:
  // What one state tells; empty: nothing new.
  std::string SafetyReason(const arm::ArmState& state, const Doing& doing);
  std::string PowerReason(const arm::ArmState& state, const Doing& doing);
  std::string ProgramReason(const arm::ArmState& state, const Doing& doing);

  double seen_s_ = -1;  // controller time of the last state looked at; below 0: none yet
  std::optional<arm::SafetyMode> latched_safety_;  // that was latched last, while it lasts
  bool ran_ = false;                               // the arm was seen running, and not without power since
  uint64_t foreign_programs_ = 0;                  // of arm::ForeignPrograms::count
  std::optional<arm::ArmState> playing_since_;     // a program runs, and none of this gateway should
  bool playing_latched_ = false;
};

}  // namespace touchstone::gateway
