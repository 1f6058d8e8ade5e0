// What the mains of the servers share: logs on stderr, and signals.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/base/process/stop_signals.h"
#include "server/service/connections/connection_acceptor.h"
#include "server/service/options/server_options.h"

namespace touchstone::service {

// Lines, or JSON objects, of at least this level ("info").
void SetUpLog(const std::string& level, bool json);

// A server connects to itself and to the parts of its rig, and to neither through a proxy: takes the variables that name one
// out of the environment, for libraries that look there (FFmpeg, of a camera's stream). Before there are threads.
void ForgetProxies();

// Prints "listening on HOST:PORT", the line that scripts wait for.
void AnnounceListening(const std::string& listen, int port);

// What went wrong, on stderr, and the exit status for it: 3 where something is unavailable, else 2.
int ReportStartError(const char* program, const absl::Status& status);
// Until a signal says otherwise, or until the process is unreachable (self_probe.h); logs what then begins. Whether it was unreachable:
// then it ends within drain_s and a little, whatever hangs.
bool ServeUntilSignal(const ServerOptions& options, int port, const char* what_begins);
void LogStopped();
// Exit status of a unreachable process: start it anew.
inline constexpr int kExitUnreachable = 70;
// EX_OSERR: it gets no more memory where a call could not be refused instead.
inline constexpr int kExitOutOfMemory = 71;

// The life of a server's process, as its exit status: log, start, serving until a signal, draining. `Flags` has
// log_level, log_json and done; `options_of` gives the options that every server has; `start` makes from the
// flags what has port() and Drain().
template <typename Flags, typename OptionsOf, typename Start>
int RunServer(const char* program, const absl::StatusOr<Flags>& flags, OptionsOf options_of,
              const char* what_a_signal_begins, Start start) {
  if (!flags.ok()) return ReportStartError(program, absl::InvalidArgumentError(flags.status().message()));
  if (flags->done) return 0;
  ForgetProxies();
  SetUpLog(flags->log_level, flags->log_json);
  TakeStopSignals(InheritedIgnore::kOverride);
  RaiseFileLimit();
  auto server = start(*flags);
  if (!server.ok()) return ReportStartError(program, server.status());
  const bool unreachable = ServeUntilSignal(options_of(*flags), (*server)->port(), what_a_signal_begins);
  (*server)->Drain();
  LogStopped();
  return unreachable ? kExitUnreachable : 0;
}

}  // namespace touchstone::service
