// A host whose wall clock is set while programs run, as by `date -s`, NTP or a battery that went flat: preloaded
// into a program (LD_PRELOAD), it adds the offset that a file holds now to the wall clock and to nothing else. What
// waits until a time of that clock wakes when that clock shows it, as the kernel does (timers(2), futex(2)
// FUTEX_CLOCK_REALTIME), which is how gRPC's timers wait on Debian 12. libfaketime knows no futex.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <limits>

namespace {

constexpr int64_t kNsPerS = 1'000'000'000;
constexpr int64_t kLookNs = 20'000'000;  // between two looks of who waits at whether the clock was set

using Offset = std::atomic<int64_t>;
static_assert(sizeof(Offset) == sizeof(int64_t) && Offset::is_always_lock_free);

// The offset in nanoseconds: the eight bytes of the file that TOUCHSTONE_HOST_CLOCK names, as whoever sets it sees them.
const Offset* shared_offset = nullptr;

__attribute__((constructor)) void MapSharedOffset() {
  const char* path = std::getenv("TOUCHSTONE_HOST_CLOCK");
  const int file = path == nullptr ? -1 : open(path, O_RDONLY | O_CLOEXEC);
  struct stat info {};
  void* bytes = MAP_FAILED;
  if (file >= 0 && fstat(file, &info) == 0 && info.st_size >= static_cast<off_t>(sizeof(Offset)))
    bytes = mmap(nullptr, sizeof(Offset), PROT_READ, MAP_SHARED, file, 0);
  if (bytes == MAP_FAILED) {
    std::fprintf(stderr, "TOUCHSTONE_HOST_CLOCK = '%s': must name a file of eight bytes\n",
                 path == nullptr ? "" : path);
    _exit(2);
  }
  close(file);
  shared_offset = static_cast<const Offset*>(bytes);
}

// The host's own function of that name.
template <typename Function>
Function* Own(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

int OwnClock(clockid_t clock, timespec* time) {
  // Found anew by each call rather than kept by a guarded static: such a guard waits by calling syscall().
  return Own<int(clockid_t, timespec*)>("clock_gettime")(clock, time);
}

int64_t WallNs() {
  timespec now{};
  OwnClock(CLOCK_REALTIME, &now);
  return now.tv_sec * kNsPerS + now.tv_nsec + (shared_offset == nullptr ? 0 : shared_offset->load());
}

timespec ToTimespec(int64_t ns) {
  const int64_t seconds = ns / kNsPerS - (ns % kNsPerS < 0 ? 1 : 0);
  return {seconds, ns - seconds * kNsPerS};
}

// Waits until the wall clock, which may be set meanwhile, shows `until`.
long WaitUntil(long (*own)(long, ...), uint32_t* word, long operation, uint32_t expected,
               const timespec& until, long mask) {
  // Who waits for ever names the end of time.
  const bool ends = until.tv_sec < std::numeric_limits<int64_t>::max() / kNsPerS;
  const int64_t until_ns =
      ends ? until.tv_sec * kNsPerS + until.tv_nsec : std::numeric_limits<int64_t>::max();
  while (true) {
    timespec now{};
    OwnClock(CLOCK_MONOTONIC, &now);
    const int64_t left_ns = until_ns - std::max<int64_t>(WallNs(), 0);
    const timespec look =
        ToTimespec(now.tv_sec * kNsPerS + now.tv_nsec + std::clamp<int64_t>(left_ns, 0, kLookNs));
    const long result =
        own(SYS_futex, word, operation & ~FUTEX_CLOCK_REALTIME, expected, &look, nullptr, mask);
    if (result != -1 || errno != ETIMEDOUT || WallNs() >= until_ns) return result;
  }
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (clock != CLOCK_REALTIME && clock != CLOCK_REALTIME_COARSE) return OwnClock(clock, time);
  *time = ToTimespec(WallNs());
  return 0;
}

int gettimeofday(timeval* time, void* zone) noexcept {
  (void)zone;
  const timespec now = ToTimespec(WallNs());
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}

time_t time(time_t* result) noexcept {
  const time_t now = ToTimespec(WallNs()).tv_sec;
  if (result != nullptr) *result = now;
  return now;
}

long syscall(long number, ...) noexcept {
  auto* const own = Own<long(long, ...)>("syscall");
  va_list list;
  va_start(list, number);
  long argument[6];
  for (long& each : argument) each = va_arg(list, long);
  va_end(list);
  const auto* until = reinterpret_cast<const timespec*>(argument[3]);
  if (number == SYS_futex && (argument[1] & FUTEX_CMD_MASK) == FUTEX_WAIT_BITSET &&
      (argument[1] & FUTEX_CLOCK_REALTIME) != 0 && until != nullptr)
    return WaitUntil(own, reinterpret_cast<uint32_t*>(argument[0]), argument[1],
                     static_cast<uint32_t>(argument[2]), *until, argument[5]);
  return own(number, argument[0], argument[1], argument[2], argument[3], argument[4], argument[5]);
}

}  // extern "C"
