#include "server/base/threads/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <utility>

#include "server/base/threads/clock.h"
#include "server/base/threads/thread_time.h"

namespace touchstone {
namespace {

// After which a task looks whether it is others' turn.
constexpr double kTurnS = FairQueue::kExpectedS;
// Threads that may wait in the middle of a task; each has a stack. As many as streams at once (max_streams).
constexpr int kMaxStopped = 256;

}  // namespace

struct ThreadPool::Running {
  ThreadPool* pool;
  FairQueue::Stream* stream;
  double begin_s = ThreadTimeS();  // of what was not charged yet
  Clock::Time looked = SteadyClock().Now();

  double Uncharged() {
    const double now_s = ThreadTimeS();
    return now_s - std::exchange(begin_s, now_s);
  }
};

thread_local ThreadPool::Running* ThreadPool::running_here_ = nullptr;

ThreadPool::ThreadPool(int tasks_at_once)
    : size_(tasks_at_once > 0 ? tasks_at_once : std::max<int>(1, std::thread::hardware_concurrency())) {
  for (int k = 0; k < size_; ++k) threads_.emplace_back([this] { Work(); });
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
  return queue_.waiting();
}

void ThreadPool::Submit(std::function<void()> task, const std::string& client, uint64_t stream) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    queue_.Add(client, stream, {std::move(task)});
  }
  wake_.notify_one();
}

void ThreadPool::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    const auto may_begin = [&] { return queue_.waiting() > 0 && running_ < size_; };
    wake_.wait(lock, [&] { return may_begin() || (stopping_ && queue_.waiting() == 0); });
    if (!may_begin()) return;
    FairQueue::Begun begun = *queue_.Begin();
    if (stopping_ && queue_.waiting() == 0) wake_.notify_all();
    ++running_;
    if (begun.task.resumes) {
      begun.task.run();  // the thread that waits in it goes on in place of this one
      continue;
    }
    lock.unlock();
    Running running{this, begun.stream};
    running_here_ = &running;
    begun.task.run();
    begun.task.run = nullptr;  // what it held goes without the lock
    running_here_ = nullptr;
    const double took_s = running.Uncharged();
    lock.lock();
    queue_.Charge(begun.stream, took_s);
    queue_.End(begun.stream);
    --running_;
  }
}

void ThreadPool::GiveWay() {
  if (running_here_ != nullptr) running_here_->pool->LetOthersGoFirst(running_here_);
}

void ThreadPool::LetOthersGoFirst(Running* running) {
  const Clock& clock = SteadyClock();
  if (clock.SecondsSince(running->looked) < kTurnS) return;
  running->looked = clock.Now();
  std::unique_lock<std::mutex> lock(mutex_);
  queue_.Charge(running->stream, running->Uncharged());
  if (stopping_ || !queue_.OthersAreNext(*running->stream) || !AddThread()) return;
  bool resumed = false;
  std::condition_variable resume;
  const auto go_on = [&] {
    --stopped_;
    resumed = true;
    resume.notify_one();
  };
  queue_.GoOnLater(running->stream, {go_on, true});
  --running_;
  ++stopped_;
  wake_.notify_one();
  resume.wait(lock, [&] { return resumed; });
  running->begin_s = ThreadTimeS();
  running->looked = clock.Now();
}

// So that size_ threads work while those that stopped and one more wait.
bool ThreadPool::AddThread() {
  if (stopped_ >= kMaxStopped) return false;
  if (static_cast<int>(threads_.size()) > size_ + stopped_) return true;
  try {
    threads_.emplace_back([this] { Work(); });
  } catch (const std::exception&) {  // the machine has no more: the task goes on
    return false;
  }
  return true;
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
