// A diagnosis in a thread of its own, with its progress.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include <absl/status/statusor.h>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/input.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::service {

// Where every diagnosis begins.
v1::Progress ProgressOfReading();

// The work runs in a thread of its own and only leaves notes here, so that progress is sent in time whatever
// the work is at, and a client that reads slowly does not hold it up.
class DiagnosisWorker {
 public:
  using Work = std::function<absl::StatusOr<v1::Report>(const diagnosis::DiagnosisContext&)>;
  DiagnosisWorker(Work work, ThreadPool* pool);
  ~DiagnosisWorker();  // cancels, and waits for the work to end

  // Waits a little; true when the work is done.
  bool Wait(v1::Progress* progress);
  void Cancel() { cancelled_ = true; }
  absl::StatusOr<v1::Report>& report() { return report_; }  // after Wait said true

 private:
  bool Note(const std::string& stage, double done);  // false: cancelled

  std::mutex mutex_;
  std::condition_variable wake_;
  v1::Progress progress_ = ProgressOfReading();
  bool finished_ = false;
  std::atomic<bool> cancelled_{false};
  absl::StatusOr<v1::Report> report_ = absl::UnknownError("not finished");
  std::thread thread_;  // last: it uses the others
};

}  // namespace touchstone::service
