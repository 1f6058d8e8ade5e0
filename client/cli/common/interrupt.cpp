#include "client/cli/common/interrupt.h"

#include <unistd.h>

#include <atomic>
#include <mutex>
#include <thread>

#include "client/cli/common/exit_code.h"
#include "server/base/process/stop_signals.h"

namespace touchstone::cli {
namespace {

std::atomic<bool> raised{false};
std::mutex handler_mutex;
std::function<void()> handler;  // guarded by handler_mutex

void WaitForSignals() {
  while (true) {
    WaitForStopSignal();
    std::lock_guard<std::mutex> lock(handler_mutex);
    if (raised.exchange(true) || !handler) _exit(kInterrupted);
    handler();
  }
}

}  // namespace

void Interrupt::Install() {
  TakeStopSignals(InheritedIgnore::kKeep);
  std::thread(WaitForSignals).detach();
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
