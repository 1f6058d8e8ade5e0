// The registers of the controller that this gateway's programs use, and what stands in them. The upper half
// (24 to 47) is kept for RTDE clients.
#pragma once

namespace touchstone::gateway::arm {

// The gateway writes (RTDE inputs).
inline constexpr int kHeartbeatRegister = 24;  // input_int_register_24: counts; watched by rtde_set_watchdog
inline constexpr int kCommandRegister = 25;    // input_int_register_25: 4 * (program id mod 2^28) + command
inline constexpr int kCommandGo = 1, kCommandRetract = 2, kCommandMove = 3;

// The program writes (RTDE outputs).
inline constexpr int kProgramRegister = 24;  // output_int_register_24: the program's id
inline constexpr int kPhaseRegister = 25;    // output_int_register_25: MotionPhase
inline constexpr double kWatchdogHz = 4;     // of heartbeats, rig time; a slower gateway means a dead one

}  // namespace touchstone::gateway::arm
