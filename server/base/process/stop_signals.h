// SIGINT and SIGTERM, delivered to whoever waits for them.
#pragma once

#include <chrono>

namespace touchstone {

enum class InheritedIgnore {
  kKeep,      // a shell that starts a program in the background has SIGINT ignored: it stays so
  kOverride,  // the signal ends the program all the same: a server that was started so is ended by name
};

// From now on both signals are kept for WaitForStopSignal and nothing else happens when they come. A handler takes them,
// not a mask with sigwait: libraries start threads before main (OpenBLAS does), those do not have the mask, and a signal
// that one of them is given would end the process. Programs started later by exec have the default handling again.
void TakeStopSignals(InheritedIgnore inherited);

// Waits for the next of them, in the order in which they came: its number. One thread at a time, after TakeStopSignals.
int WaitForStopSignal();
// The same, but waits no longer than `timeout`: 0 if none came.
int WaitForStopSignal(std::chrono::milliseconds timeout);

}  // namespace touchstone
