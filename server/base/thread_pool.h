// A fixed number of threads that run tasks, those of one client in the order given and those of several clients in turn:
// next is whose tasks have taken the least processor time, so that nobody waits for all that another one has asked for.
// Tasks must not wait for other tasks.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace touchstone {

class ThreadPool {
 public:
  explicit ThreadPool(int threads);  // 0: one per core
  ~ThreadPool();                     // runs what was submitted, then joins

  int size() const { return static_cast<int>(threads_.size()); }
  size_t waiting() const;  // tasks that no thread has begun
  // A task for a client, of any name. What leaves a task as an exception ends the process.
  void Submit(std::function<void()> task, const std::string& client = "");

  // Calls body(begin, end) over pieces of 0 .. count, of `grain` at the most, here and in the pool, and
  // returns when all are done. May be called from several threads at once, not from inside a task.
  void ParallelFor(int count, int grain, const std::function<void(int begin, int end)>& body);

 private:
  struct Queue {
    std::deque<std::function<void()>> tasks;
    int running = 0;
    double used_s = 0;      // processor time, with what its running tasks will probably take
    double expected_s = 0;  // of its next task: that of its last one
  };
  using Queues = std::map<std::string, Queue>;

  void Work();
  Queues::iterator NextQueue();  // that a task comes from; queues_.end(): there is none
  void ForgetIdleQueues();

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  Queues queues_;
  // used_s of whose turn it was last. Who comes anew begins here, so that nobody saves up time by idling.
  double turn_s_ = 0;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

// The same on a pool that may be missing: then body(0, count) runs here.
void ParallelFor(ThreadPool* pool, int count, int grain, const std::function<void(int begin, int end)>& body);

}  // namespace touchstone
