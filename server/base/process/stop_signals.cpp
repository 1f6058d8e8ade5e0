#include "server/base/process/stop_signals.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>

namespace touchstone {
namespace {

// The handler writes a signal's number, a byte, to one end; who waits reads it from the other. write is one of the few
// functions that a handler may call (POSIX.1-2017, 2.4.3).
int pipe_ends[2] = {-1, -1};

void Pass(int signal) {
  const int error = errno;
  const auto number = static_cast<uint8_t>(signal);
  // Full only when thousands of signals are unread; one more would say nothing new.
  [[maybe_unused]] const ssize_t written = write(pipe_ends[1], &number, 1);
  errno = error;
}

}  // namespace

void TakeStopSignals(InheritedIgnore inherited) {
  if (pipe_ends[0] < 0) {
    if (pipe2(pipe_ends, O_CLOEXEC) != 0) {
      std::perror("touchstone: no pipe for signals");
      std::abort();
    }
    fcntl(pipe_ends[1], F_SETFL, O_NONBLOCK);
  }
  struct sigaction action {};
  action.sa_handler = Pass;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction before {};
    sigaction(signal, nullptr, &before);
    if (inherited == InheritedIgnore::kKeep && before.sa_handler == SIG_IGN) continue;
    sigaction(signal, &action, nullptr);
  }
}

int WaitForStopSignal() {
  while (true) {
    uint8_t number = 0;
    if (read(pipe_ends[0], &number, 1) == 1) return number;
  }
}

int WaitForStopSignal(std::chrono::milliseconds timeout) {
  pollfd readable{pipe_ends[0], POLLIN, 0};
  return poll(&readable, 1, static_cast<int>(timeout.count())) == 1 ? WaitForStopSignal() : 0;
}

}  // namespace touchstone
