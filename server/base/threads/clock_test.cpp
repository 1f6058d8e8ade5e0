#include "server/base/threads/clock.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "server/base/threads/manual_clock.h"

namespace touchstone {
namespace {

TEST(SteadyClock, AWaitEndsAtItsTimeOrWithWhatItWaitsFor) {
  const Clock& clock = SteadyClock();
  std::mutex mutex;
  std::condition_variable changed;
  std::unique_lock<std::mutex> lock(mutex);
  const double began_s = clock.NowS();
  EXPECT_FALSE(clock.WaitFor(lock, changed, 0.01, [] { return false; }));
  EXPECT_GE(clock.NowS() - began_s, 0.01);
  EXPECT_TRUE(clock.WaitFor(lock, changed, 1e300, [] { return true; }));
  bool done = false;
  std::thread other([&] {
    const std::lock_guard<std::mutex> changing(mutex);
    done = true;
    changed.notify_all();
  });
  EXPECT_TRUE(clock.WaitFor(lock, changed, 1e300, [&] { return done; }));
  lock.unlock();
  other.join();
}

TEST(ManualClock, StandsStillUntilItIsMoved) {
  ManualClock clock;
  const Clock::Time began = clock.Now();
  EXPECT_EQ(clock.Now(), began);
  clock.Advance(2.5);
  EXPECT_EQ(clock.SecondsSince(began), 2.5);
}

TEST(ManualClock, WakesWhoseTimeHasComeAndNobodyElse) {
  ManualClock clock;
  std::atomic<int> woken{0};
  std::thread early([&] { clock.SleepFor(1), ++woken; });
  std::thread late([&] { clock.SleepFor(3), ++woken; });
  clock.AwaitWaiters(2);
  clock.Advance(1);
  early.join();
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(clock.AdvanceToFirst(), 2);
  late.join();
  EXPECT_EQ(woken, 2);
}

// Again and again, since a wake-up that is lost between a look at the time and the wait would be rare.
TEST(ManualClock, LosesNoWaiterThatComesWhileItIsMoved) {
  ManualClock clock;
  std::atomic<bool> ended{false};
  std::thread sleeper([&] {
    for (int k = 0; k < 2000; ++k) clock.SleepFor(0.5);
    ended = true;
  });
  while (!ended) clock.Advance(0.25);
  sleeper.join();
}

TEST(ManualClock, AWaiterHearsWhatItWaitsForWhileTheClockStands) {
  const ManualClock clock;
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  std::thread other([&] {
    clock.AwaitWaiters();
    const std::lock_guard<std::mutex> changing(mutex);
    done = true;
    changed.notify_all();
  });
  std::unique_lock<std::mutex> lock(mutex);
  EXPECT_TRUE(clock.WaitFor(lock, changed, 1, [&] { return done; }));
  lock.unlock();
  other.join();
}

}  // namespace
}  // namespace touchstone
