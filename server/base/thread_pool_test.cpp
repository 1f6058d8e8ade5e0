#include "server/base/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>

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

}  // namespace
}  // namespace touchstone
