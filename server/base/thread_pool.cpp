#include "server/base/thread_pool.h"

#include <time.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <iterator>
#include <memory>

namespace touchstone {
namespace {

double ProcessorTimeS() {
  timespec time;
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec + 1e-9 * time.tv_nsec;
}

}  // namespace

ThreadPool::ThreadPool(int threads) {
  if (threads <= 0) threads = std::max(1u, std::thread::hardware_concurrency());
  for (int k = 0; k < threads; ++k) threads_.emplace_back([this] { Work(); });
}

ThreadPool::~ThreadPool() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

size_t ThreadPool::waiting() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  size_t waiting = 0;
  for (const auto& [client, queue] : queues_) waiting += queue.tasks.size();
  return waiting;
}

void ThreadPool::Submit(std::function<void()> task, const std::string& client) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    Queue& queue = queues_[client];
    if (queue.tasks.empty() && queue.running == 0) queue.used_s = std::max(queue.used_s, turn_s_);
    queue.tasks.push_back(std::move(task));
  }
  wake_.notify_one();
}

ThreadPool::Queues::iterator ThreadPool::NextQueue() {
  auto next = queues_.end();
  for (auto queue = queues_.begin(); queue != queues_.end(); ++queue)
    if (!queue->second.tasks.empty() && (next == queues_.end() || queue->second.used_s < next->second.used_s))
      next = queue;
  return next;
}

// One that used more than its share is remembered until the others have had theirs.
void ThreadPool::ForgetIdleQueues() {
  for (auto queue = queues_.begin(); queue != queues_.end();) {
    const Queue& each = queue->second;
    const bool idle = each.tasks.empty() && each.running == 0 && each.used_s <= turn_s_;
    queue = idle ? queues_.erase(queue) : std::next(queue);
  }
}

void ThreadPool::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    auto next = queues_.end();
    wake_.wait(lock, [&] { return (next = NextQueue()) != queues_.end() || stopping_; });
    if (next == queues_.end()) return;
    Queue& queue = next->second;
    std::function<void()> task = std::move(queue.tasks.front());
    queue.tasks.pop_front();
    turn_s_ = std::max(turn_s_, queue.used_s);
    const double expected_s = queue.expected_s;
    queue.used_s += expected_s;
    ++queue.running;
    lock.unlock();
    const double before_s = ProcessorTimeS();
    task();
    task = nullptr;  // what it held goes without the lock
    const double took_s = ProcessorTimeS() - before_s;
    lock.lock();
    --queue.running;
    queue.used_s += took_s - expected_s;
    queue.expected_s = took_s;
    ForgetIdleQueues();
  }
}

void ThreadPool::ParallelFor(int count, int grain, const std::function<void(int, int)>& body) {
  grain = std::max(1, grain);
  const int pieces = (count + grain - 1) / grain;
  // Shared with tasks that may start only after all work is done and this call has returned.
  struct Shared {
    std::atomic<int> next{0};
    std::atomic<bool> failed{false};
    std::mutex mutex;
    std::condition_variable done;
    int finished = 0;
    std::exception_ptr error;  // the first; pieces that begin after it are not called
  };
  auto shared = std::make_shared<Shared>();
  const std::function<void(int, int)>* call =
      &body;  // used only while a piece is left, that is, before we return
  const auto work = [shared, call, pieces, grain, count] {
    for (;;) {
      const int piece = shared->next++;
      if (piece >= pieces) return;
      std::exception_ptr error;
      try {
        if (!shared->failed) (*call)(piece * grain, std::min(count, (piece + 1) * grain));
      } catch (...) {
        error = std::current_exception();
        shared->failed = true;
      }
      std::lock_guard<std::mutex> lock(shared->mutex);
      if (error && !shared->error) shared->error = error;
      if (++shared->finished == pieces) shared->done.notify_all();
    }
  };
  for (int k = 1; k < std::min(pieces, size() + 1); ++k) Submit(work);
  work();
  std::unique_lock<std::mutex> lock(shared->mutex);
  shared->done.wait(lock, [&] { return shared->finished == pieces; });
  if (shared->error) std::rethrow_exception(shared->error);
}

void ParallelFor(ThreadPool* pool, int count, int grain,
                 const std::function<void(int begin, int end)>& body) {
  if (pool != nullptr)
    pool->ParallelFor(count, grain, body);
  else
    body(0, count);
}

}  // namespace touchstone
