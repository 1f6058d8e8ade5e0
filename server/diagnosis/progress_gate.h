// Progress of a diagnosis that works in several parts and threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <mutex>
#include <string>

#include "server/diagnosis/input.h"

namespace touchstone::diagnosis {

// Passes progress on from whatever thread works, one at a time, and remembers a cancellation. The share that is done never
// falls: a part that begins again tells of its stage alone. `context` must outlive it.
class ProgressGate {
 public:
  explicit ProgressGate(const DiagnosisContext& context) : context_(context) {}

  // A stage and the share that is done by now. Returns false once cancelled.
  bool Enter(const std::string& stage, double done) {
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_ = stage;
    done_ = std::max(done_, done);
    return Report();
  }
  // The same stage continues. Busy threads do not wait for each other.
  bool Continue() {
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (lock.owns_lock()) Report();
    return !cancelled_;
  }

 private:
  bool Report() {
    if (context_.progress && !cancelled_ && !context_.progress(stage_, done_)) cancelled_ = true;
    return !cancelled_;
  }
  const DiagnosisContext& context_;
  std::mutex mutex_;
  std::string stage_ = "reading";
  double done_ = 0;
  std::atomic<bool> cancelled_{false};
};

}  // namespace touchstone::diagnosis
