#include "server/base/threads/thread_pool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "server/base/threads/thread_time.h"

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

// Spins until the task has cost so much processor time, which on a busy machine is not the time that passes.
void Work(std::chrono::duration<double> time) {
  const double until = ThreadTimeS() + time.count();
  while (ThreadTimeS() < until) {
  }
}

// Of one thread that has 60 tasks of the client "many" when 3 others come: how many it has run when it has run those.
int TasksUntilTheFewAreDone(const std::string& client_of_few) {
  std::vector<std::string> order;
  {
    ThreadPool pool(1);
    std::mutex gate;
    gate.lock();
    pool.Submit([&] { std::lock_guard<std::mutex> wait(gate); });
    for (int k = 0; k < 60; ++k)
      pool.Submit([&] { Work(std::chrono::milliseconds(2)), order.push_back("many"); }, "many", 1);
    for (int k = 0; k < 3; ++k)
      pool.Submit([&] { Work(std::chrono::milliseconds(2)), order.push_back("few"); }, client_of_few, 2);
    gate.unlock();
  }
  EXPECT_EQ(order.size(), 63u);
  return order.rend() - std::find(order.rbegin(), order.rend(), "few");
}

TEST(ThreadPool, AFewTasksOfOneClientDoNotWaitForManyOfAnother) {
  EXPECT_LT(TasksUntilTheFewAreDone("few"), 30);
}

TEST(ThreadPool, AStreamDoesNotWaitForTheManyTasksOfAnotherOneOfItsClient) {
  EXPECT_LT(TasksUntilTheFewAreDone("many"), 30);
}

// By what they cost, not by how many they are.
TEST(ThreadPool, AClientOfLongTasksHasFewerTurns) {
  std::vector<std::string> order;
  {
    ThreadPool pool(1);
    std::mutex gate;
    gate.lock();
    pool.Submit([&] { std::lock_guard<std::mutex> wait(gate); });
    for (int k = 0; k < 20; ++k)
      pool.Submit([&] { Work(std::chrono::milliseconds(20)), order.push_back("long"); }, "long");
    for (int k = 0; k < 40; ++k)
      pool.Submit([&] { Work(std::chrono::milliseconds(1)), order.push_back("short"); }, "short");
    gate.unlock();
  }
  const auto last = std::find(order.rbegin(), order.rend(), "short");
  EXPECT_LT(std::count(last, order.rend(), "long"), 12) << "long tasks before the last short one";
}

// A task goes on until another one, which the pool has no thread for, has run.
TEST(ThreadPool, ALongTaskGivesWayToOthersInItsMiddle) {
  for (const char* other : {"another client", "client"}) {
    std::atomic<bool> begun{false}, done{false}, ended{false};
    ThreadPool pool(1);
    pool.Submit(
        [&] {
          begun = true;
          const auto limit = std::chrono::steady_clock::now() + std::chrono::minutes(1);
          while (!done && std::chrono::steady_clock::now() < limit) ThreadPool::GiveWay();
          ended = true;
        },
        "client", 1);
    while (!begun) std::this_thread::yield();
    pool.Submit([&] { done = true; }, other, 2);
    while (!ended) std::this_thread::yield();
    EXPECT_TRUE(done) << other << " had no turn";
  }
}

TEST(ThreadPool, RunsNoMoreAtOnceWhenTasksWaitInTheirMiddle) {
  std::atomic<int> at_once{0}, most{0}, ended{0};
  {
    ThreadPool pool(2);
    for (uint64_t stream = 0; stream < 10; ++stream)
      for (int k = 0; k < 2; ++k)
        pool.Submit(
            [&] {
              for (int piece = 0; piece < 5; ++piece) {
                const int now = ++at_once;
                for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
                }
                Work(std::chrono::milliseconds(10));
                --at_once;
                ThreadPool::GiveWay();
              }
              ++ended;
            },
            stream % 2 == 0 ? "even" : "odd", stream);
    // Most are in their middle when the pool is to end.
    while (ended == 0) std::this_thread::yield();
  }
  EXPECT_EQ(ended, 20) << "a pool ends when all tasks have";
  EXPECT_LE(most, 2);
}

TEST(ThreadPool, OutsideOfATaskNobodyGivesWay) {
  ThreadPool::GiveWay();
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
