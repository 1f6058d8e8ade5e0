// Linked with steady_waits.cpp. That the wall clock is set meanwhile is tried by tests/faults/clock_jumps.py.
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <limits>
#include <thread>

#include <gtest/gtest.h>

namespace touchstone {
namespace {

using std::chrono::milliseconds;

timespec WallIn(int64_t ns) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  const int64_t until_ns = now.tv_sec * 1'000'000'000 + now.tv_nsec + ns;
  return {until_ns / 1'000'000'000, until_ns % 1'000'000'000};
}

class SteadyWaits : public testing::Test {
 protected:
  // As abseil does. 0: woken; otherwise the error.
  int Wait(const timespec& until) {
    const long result =
        syscall(SYS_futex, &word_, FUTEX_WAIT_BITSET | FUTEX_PRIVATE_FLAG | FUTEX_CLOCK_REALTIME, 0, &until,
                nullptr, FUTEX_BITSET_MATCH_ANY);
    return result == 0 ? 0 : errno;
  }
  milliseconds Since(std::chrono::steady_clock::time_point began) const {
    return std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - began);
  }
  std::atomic<int32_t> word_{0};
};

TEST_F(SteadyWaits, LastUntilTheirTime) {
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(Wait(WallIn(80'000'000)), ETIMEDOUT);
  EXPECT_GE(Since(began), milliseconds(79));
}

TEST_F(SteadyWaits, EndAtOnceWhereTheirTimeIsOver) {
  EXPECT_EQ(Wait(WallIn(-1)), ETIMEDOUT);
  EXPECT_EQ(Wait({0, 0}), ETIMEDOUT);
  EXPECT_EQ(Wait({std::numeric_limits<int64_t>::min(), 0}), ETIMEDOUT);
}

TEST_F(SteadyWaits, AreWokenBeforeTheEndOfTime) {
  std::atomic<int> ended{-1};
  std::thread waiter([&] { ended = Wait({std::numeric_limits<int64_t>::max(), 0}); });
  while (ended == -1) {
    std::this_thread::sleep_for(milliseconds(5));
    syscall(SYS_futex, &word_, FUTEX_WAKE | FUTEX_PRIVATE_FLAG, 1, nullptr, nullptr, 0);
  }
  waiter.join();
  EXPECT_EQ(ended, 0);
}

TEST_F(SteadyWaits, LeaveOtherCallsAsTheyAre) {
  EXPECT_EQ(syscall(SYS_getpid), getpid());
  word_ = 1;
  EXPECT_EQ(Wait(WallIn(1'000'000'000)), EAGAIN);  // the word is not what was expected
  EXPECT_EQ(syscall(SYS_close, -1), -1);
  EXPECT_EQ(errno, EBADF);
}

}  // namespace
}  // namespace touchstone
