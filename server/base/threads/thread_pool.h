// Runs tasks, a fixed number of them at once, of clients and their streams in turn (fair_queue.h). Tasks must not wait for
// other tasks.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/base/threads/fair_queue.h"

namespace touchstone {

class ThreadPool {
 public:
  explicit ThreadPool(int tasks_at_once);  // 0: one per core
  ~ThreadPool();                           // runs what was submitted, then joins

  int size() const { return size_; }  // tasks at once
  size_t waiting() const;             // tasks that wait for their turn, or for going on
  // A task for a client, of any name, and its stream, of any number. What leaves a task as an exception ends the process.
  void Submit(std::function<void()> task, const std::string& client = "", uint64_t stream = 0);
  // Within a task that may take long, every now and then, holding no lock: where it ran for some hundredths of a second
  // and others' turn has come, they go first, and this returns later. Elsewhere nothing.
  static void GiveWay();

  // Calls body(begin, end) over pieces of 0 .. count, of `grain` at the most, here and in the pool, and
  // returns when all are done. May be called from several threads at once, not from inside a task.
  void ParallelFor(int count, int grain, const std::function<void(int begin, int end)>& body);

 private:
  // A task that a thread of the pool is running.
  struct Running;

  void Work();
  void LetOthersGoFirst(Running* running);
  bool AddThread();  // mutex_ is held; whether there is one more

  static thread_local Running* running_here_;
  const int size_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  FairQueue queue_;
  int running_ = 0;  // tasks: size_ at the most
  int stopped_ = 0;  // threads that wait in the middle of a task
  bool stopping_ = false;
  std::vector<std::thread> threads_;  // more than size_ where tasks were stopped
};

// The same on a pool that may be missing: then body(0, count) runs here.
void ParallelFor(ThreadPool* pool, int count, int grain, const std::function<void(int begin, int end)>& body);

}  // namespace touchstone
