// The switches of tests/mutation. Every mutated expression is compiled both ways and asks On(number) which one counts.
//   TOUCHSTONE_MUTANT          the number of the mutant that is on; none when unset
//   TOUCHSTONE_MUTANT_REACHED  a file that gets the number of every mutant that was executed, a line each, once per process
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>

namespace touchstone_mutant {

constexpr int kMaxMutants = 4096;
inline std::atomic<bool> reached[kMaxMutants];

// One write of a short line with O_APPEND: whole beside other threads and processes, and there although the process is
// killed afterwards.
[[gnu::cold, gnu::noinline]] inline void Reach(int number) {
  if (reached[number].exchange(true)) return;
  const char* path = std::getenv("TOUCHSTONE_MUTANT_REACHED");
  if (path == nullptr) return;
  const int error = errno;  // the expression may stand between a system call and the look at its error
  const int file = ::open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file >= 0) {
    char line[16];
    const int size = std::snprintf(line, sizeof(line), "%d\n", number);
    if (::write(file, line, size) != size) std::abort();
    ::close(file);
  }
  errno = error;
}

inline int Chosen() {
  static const int chosen = [] {
    const char* number = std::getenv("TOUCHSTONE_MUTANT");
    return number == nullptr ? -1 : std::atoi(number);
  }();
  return chosen;
}

inline bool On(int number) {
  if (!reached[number].load(std::memory_order_relaxed)) Reach(number);
  return Chosen() == number;
}

}  // namespace touchstone_mutant
