// What a source is doing, or what keeps it from moving.
#pragma once

namespace touchstone::source {

// The numbers are those of v1::SourceState.
enum class SourceState : int {
  kIdle = 1,
  kBusy = 2,
  kDraining = 3,
  // What follows, at a physical source only.
  kStopped = 4,  // Stop was called, and Reset not yet
  kProtectiveStop = 5,
  kSafeguardStop = 6,
  kRecovery = 7,
  kEmergencyStop = 8,
  kPoweredOff = 9,
  kDisconnected = 10,  // the arm's controller or the end effector does not answer
  kFault = 11,         // a violation or a fault of the controller's safety system
};

}  // namespace touchstone::source
