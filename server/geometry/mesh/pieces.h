// Work on a large mesh, shared among the cores.
#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>

#include "server/base/threads/thread_pool.h"

namespace touchstone::geometry {

// Calls body(begin, end) for consecutive pieces of 0 .. count, one a core (eight at most), and returns when all are
// done. Where `count` is small one call does it here. A body must write only what belongs to its piece; then the
// result is the same for any number of cores.
template <typename Body>
void InPieces(size_t count, const Body& body) {
  constexpr size_t kSmall = 1 << 16;
  if (count < kSmall) return body(size_t{0}, count);
  const int pieces = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 8);
  ThreadPool helpers(std::max(1, pieces - 1));
  helpers.ParallelFor(static_cast<int>(count), static_cast<int>((count + pieces - 1) / pieces), body);
}

}  // namespace touchstone::geometry
