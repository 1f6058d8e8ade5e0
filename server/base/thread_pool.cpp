#include "server/base/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>

namespace touchstone {

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

void ThreadPool::Submit(std::function<void()> task) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  wake_.notify_one();
}

void ThreadPool::Work() {
  for (;;) {
    std::function<void()> task;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait(lock, [this] { return stopping_ || !tasks_.empty(); });
      if (tasks_.empty()) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    task();
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
