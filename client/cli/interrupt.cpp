#include "client/cli/interrupt.h"

#include <pthread.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <thread>

#include "client/cli/exit_code.h"

namespace touchstone::cli {
namespace {

std::atomic<bool> raised{false};
std::mutex handler_mutex;
std::function<void()> handler;  // guarded by handler_mutex

void WaitForSignals(sigset_t signals) {
  while (true) {
    int signal = 0;
    if (sigwait(&signals, &signal) != 0) continue;
    std::lock_guard<std::mutex> lock(handler_mutex);
    if (raised.exchange(true) || !handler) _exit(kInterrupted);
    handler();
  }
}

}  // namespace

void Interrupt::Install() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread(WaitForSignals, signals).detach();
}

bool Interrupt::Raised() {
  return raised;
}

Interrupt::Handler::Handler(std::function<void()> on_signal) {
  std::lock_guard<std::mutex> lock(handler_mutex);
  handler = std::move(on_signal);
}

Interrupt::Handler::~Handler() {
  std::lock_guard<std::mutex> lock(handler_mutex);
  handler = nullptr;
}

}  // namespace touchstone::cli
