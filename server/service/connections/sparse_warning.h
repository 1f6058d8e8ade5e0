// Warnings that any client can cause as often as it likes: a flood of them is one line a second in the log.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "server/base/threads/clock.h"

namespace touchstone::service {

// Thread-safe.
class SparseWarning {
 public:
  // `clock` outlives it.
  explicit SparseWarning(const Clock& clock = SteadyClock()) : clock_(clock) {}
  // With how many were left out before.
  void Say(const std::string& words);

 private:
  const Clock& clock_;
  std::mutex mutex_;
  Clock::Time said_{};
  uint64_t unsaid_ = 0;
};

}  // namespace touchstone::service
