#include "server/base/process/stop_signals.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <thread>

#include <gtest/gtest.h>

namespace touchstone {
namespace {

using std::chrono::milliseconds;

// What a process of its own makes of `body`: its exit status, or minus the signal that ended it.
int StatusOf(const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) _exit(body());
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

TEST(StopSignals, ComeInTheirOrder) {
  EXPECT_EQ(StatusOf([] {
              TakeStopSignals(InheritedIgnore::kKeep);
              kill(getpid(), SIGTERM);
              kill(getpid(), SIGINT);
              return WaitForStopSignal() == SIGTERM && WaitForStopSignal() == SIGINT ? 0 : 1;
            }),
            0);
}

TEST(StopSignals, AThreadOlderThanTheyAreDoesNotDieOfThem) {
  EXPECT_EQ(StatusOf([] {
              // A signal to the process goes to any thread that has it unblocked: here that is the other one alone.
              std::thread older([] { std::this_thread::sleep_for(std::chrono::hours(1)); });
              sigset_t signals;
              sigemptyset(&signals);
              sigaddset(&signals, SIGINT);
              pthread_sigmask(SIG_BLOCK, &signals, nullptr);
              TakeStopSignals(InheritedIgnore::kKeep);
              kill(getpid(), SIGINT);
              const int signal = WaitForStopSignal();
              older.detach();
              return signal == SIGINT ? 0 : 1;
            }),
            0);
}

TEST(StopSignals, ZeroIfNoneCame) {
  EXPECT_EQ(StatusOf([] {
              TakeStopSignals(InheritedIgnore::kKeep);
              return WaitForStopSignal(milliseconds(1));
            }),
            0);
}

TEST(StopSignals, AnInheritedIgnoreStaysUnlessItIsOverridden) {
  const auto signal_after = [](InheritedIgnore inherited) {
    return StatusOf([inherited] {
      signal(SIGINT, SIG_IGN);
      TakeStopSignals(inherited);
      kill(getpid(), SIGINT);
      return WaitForStopSignal(milliseconds(1));
    });
  };
  EXPECT_EQ(signal_after(InheritedIgnore::kKeep), 0);
  EXPECT_EQ(signal_after(InheritedIgnore::kOverride), SIGINT);
}

TEST(StopSignals, AProgramStartedLaterHasTheDefaultHandling) {
  EXPECT_EQ(StatusOf([] {
              TakeStopSignals(InheritedIgnore::kOverride);
              execlp("sh", "sh", "-c", "kill -TERM $$; exit 0", nullptr);
              return 1;
            }),
            -SIGTERM);
}

}  // namespace
}  // namespace touchstone
