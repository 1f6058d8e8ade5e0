// A fixed number of threads that run tasks in the order given. Tasks must not wait for other tasks.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace touchstone {

class ThreadPool {
 public:
  explicit ThreadPool(int threads);  // 0: one per core
  ~ThreadPool();                     // runs what was submitted, then joins

  int size() const { return static_cast<int>(threads_.size()); }
  void Submit(std::function<void()> task);

  // Calls body(begin, end) over pieces of 0 .. count, of `grain` at the most, here and in the pool, and
  // returns when all are done. May be called from several threads at once, not from inside a task.
  void ParallelFor(int count, int grain, const std::function<void(int begin, int end)>& body);

 private:
  void Work();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> tasks_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

// The same on a pool that may be missing: then body(0, count) runs here.
void ParallelFor(ThreadPool* pool, int count, int grain, const std::function<void(int begin, int end)>& body);

}  // namespace touchstone
