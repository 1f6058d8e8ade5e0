// What the mains of the servers share: logs on stderr, and signals.
#pragma once

#include <string>

namespace touchstone {

// Lines, or JSON objects, of at least this level ("info").
void SetUpLog(const std::string& level, bool json);

// Signals are taken by one thread alone, with sigwait, so that nothing happens inside a handler: call this
// before any thread is made.
void BlockSignals();
// Waits for SIGTERM or SIGINT; which.
int WaitForSignal();

// Prints "listening on HOST:PORT", the line that scripts wait for.
void AnnounceListening(const std::string& listen, int port);

}  // namespace touchstone
