// Lets waits with a time limit last as long as they were asked to, whatever happens to the wall clock.
//
// gRPC's timers (deadlines, handshakes, keepalive, the waits between two attempts) wait in abseil, and the abseil of Debian
// 12 (20220623; later ones use the steady clock) has the kernel wake it when the wall clock shows a time. Set that
// clock back an hour, as NTP does after a start with a flat battery, and no timer fires for an hour; no call of gRPC's
// or of abseil's can wake its timers before. Both reach the kernel through libc's syscall(), which a program may define
// itself: this one turns the wall time into the same time of the steady clock when the wait begins, and leaves every
// other call as it is. Linked into the programs, not into libraries.
#include <dlfcn.h>
#include <linux/futex.h>
#include <sys/syscall.h>

#include <algorithm>
#include <atomic>
#include <cstdarg>
#include <cstdint>
#include <ctime>

namespace {

using Syscall = long (*)(long, ...);

// No static within a function: its guard waits by this very call.
std::atomic<Syscall> libc_syscall{nullptr};

Syscall LibcSyscall() {
  Syscall found = libc_syscall.load(std::memory_order_acquire);
  if (found == nullptr) {
    found = reinterpret_cast<Syscall>(dlsym(RTLD_NEXT, "syscall"));
    libc_syscall.store(found, std::memory_order_release);
  }
  return found;
}

constexpr int64_t kNsPerS = 1'000'000'000;
// What is waited for longer is waited for so long, and then again: who waits for ever names the end of time.
constexpr int64_t kLongestS = 1'000'000'000;

timespec SteadyTimeOf(const timespec& wall) {
  timespec wall_now{}, steady_now{};
  clock_gettime(CLOCK_REALTIME, &wall_now);
  clock_gettime(CLOCK_MONOTONIC, &steady_now);
  const int64_t wait_s =
      std::clamp<int64_t>(wall.tv_sec, wall_now.tv_sec - 1, wall_now.tv_sec + kLongestS) - wall_now.tv_sec;
  const int64_t wait_ns = std::max<int64_t>(wait_s * kNsPerS + wall.tv_nsec - wall_now.tv_nsec, 0);
  const int64_t until_ns = steady_now.tv_sec * kNsPerS + steady_now.tv_nsec + wait_ns;
  return {until_ns / kNsPerS, until_ns % kNsPerS};
}

}  // namespace

extern "C" long syscall(long number, ...) noexcept {
  // As many as any call of the kernel has; what the caller did not give is not used by it either.
  long argument[6];
  va_list list;
  va_start(list, number);
  for (long& each : argument) each = va_arg(list, long);
  va_end(list);
  timespec until;
  if (number == SYS_futex && (argument[1] & FUTEX_CMD_MASK) == FUTEX_WAIT_BITSET &&
      (argument[1] & FUTEX_CLOCK_REALTIME) != 0 && argument[3] != 0) {
    until = SteadyTimeOf(*reinterpret_cast<const timespec*>(argument[3]));
    argument[1] &= ~static_cast<long>(FUTEX_CLOCK_REALTIME);
    argument[3] = reinterpret_cast<long>(&until);
  }
  return LibcSyscall()(number, argument[0], argument[1], argument[2], argument[3], argument[4], argument[5]);
}
