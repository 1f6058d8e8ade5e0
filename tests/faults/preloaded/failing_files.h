// What failing_files.cpp makes of the calls of a program on the files below one folder.
#pragma once

#include <atomic>
#include <cstdint>

namespace touchstone::faults {

enum class FailureMode : int32_t {
  kOnce,        // the n-th call fails
  kFromThenOn,  // and all that follow
  kShort,       // writes half of what it was given
  kKill,        // the program is killed before it
  kRemoval      // the n-th removal fails; only those are counted
};

// Laid out alike in failing_files.py. Shared by the program and whoever watches it.
struct FailurePlan {
  char folder[1024];              // its real path
  std::atomic<int32_t> fails_at;  // counted from 1; 0: never
  std::atomic<FailureMode> mode;
  std::atomic<int32_t> error;  // errno
  std::atomic<int32_t> calls;  // so far
  char failed[64];             // the call that failed
};

// The plan of this process, when failing_files.cpp is linked into it.
void SetFailurePlan(FailurePlan* plan);

}  // namespace touchstone::faults
