#include "server/service/rpc/diagnosis_worker.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>
#include <new>

namespace touchstone::service {
namespace {

constexpr std::chrono::milliseconds kProgressInterval{250};

// Nothing catches what leaves a thread: the process would end, and with it what other clients do.
absl::StatusOr<v1::Report> WithoutExceptions(const DiagnosisWorker::Work& work,
                                             const diagnosis::DiagnosisContext& context) {
  try {
    return work(context);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("there is not enough memory for this set at this server");
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("the diagnosis ended with an unexpected error: ", error.what()));
  }
}

}  // namespace

v1::Progress ProgressOfReading() {
  v1::Progress progress;
  progress.set_stage("reading");
  return progress;
}

DiagnosisWorker::DiagnosisWorker(Work work, ThreadPool* pool)
    : thread_([this, work = std::move(work), pool] {
        diagnosis::DiagnosisContext context;
        context.pool = pool;
        context.progress = [this](const std::string& stage, double done) { return Note(stage, done); };
        absl::StatusOr<v1::Report> report = WithoutExceptions(work, context);
        std::lock_guard<std::mutex> lock(mutex_);
        report_ = std::move(report);
        finished_ = true;
        wake_.notify_all();
      }) {}

DiagnosisWorker::~DiagnosisWorker() {
  cancelled_ = true;
  thread_.join();
}

bool DiagnosisWorker::Wait(v1::Progress* progress) {
  std::unique_lock<std::mutex> lock(mutex_);
  wake_.wait_for(lock, kProgressInterval, [&] { return finished_; });
  *progress = progress_;
  return finished_;
}

bool DiagnosisWorker::Note(const std::string& stage, double done) {
  std::lock_guard<std::mutex> lock(mutex_);
  progress_.set_stage(stage);
  progress_.set_done(std::min(std::max(done, 0.0), 1.0));
  return !cancelled_;
}

}  // namespace touchstone::service
