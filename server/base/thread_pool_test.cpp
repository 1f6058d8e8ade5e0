#include "server/base/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <new>

namespace touchstone {
namespace {

TEST(ThreadPool, RunsEveryTaskBeforeItEnds) {
  std::atomic<int> done{0};
  {
    ThreadPool pool(3);
    for (int k = 0; k < 100; ++k) pool.Submit([&] { ++done; });
  }
  EXPECT_EQ(done, 100);
}

TEST(ThreadPool, ParallelForCoversEveryElementOnce) {
  ThreadPool pool(2);
  for (int count : {0, 1, 7, 1000}) {
    std::vector<std::atomic<int>> seen(count);
    pool.ParallelFor(count, 7, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) ++seen[k];
    });
    for (const auto& times : seen) EXPECT_EQ(times, 1);
  }
}

TEST(ThreadPool, ParallelForDoesNotWaitForABusyPool) {
  ThreadPool pool(1);
  std::mutex gate;
  gate.lock();
  pool.Submit([&] { std::lock_guard<std::mutex> wait(gate); });
  int sum = 0;
  pool.ParallelFor(10, 1, [&](int begin, int) { sum += begin; });  // this thread does it all
  EXPECT_EQ(sum, 45);
  gate.unlock();
}

// An exception in a thread of the pool would end the process.
TEST(ThreadPool, ParallelForThrowsInTheCallerWhatAPieceThrew) {
  ThreadPool pool(3);
  for (int bad : {0, 57, 99}) {
    EXPECT_THROW(pool.ParallelFor(100, 1,
                                  [bad](int begin, int) {
                                    if (begin == bad) throw std::bad_alloc();
                                  }),
                 std::bad_alloc);
  }
  std::atomic<int> done{0};
  pool.ParallelFor(100, 1, [&](int, int) { ++done; });
  EXPECT_EQ(done, 100) << "the pool works on";
}

}  // namespace
}  // namespace touchstone
