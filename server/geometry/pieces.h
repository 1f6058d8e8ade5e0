// Work on a large mesh, shared among the cores.
#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>
#include <vector>

namespace touchstone::geometry {

// Calls body(begin, end) for consecutive pieces of 0 .. count, one a core (eight at most), and returns when all are
// done. Where `count` is small one call does it here. A body must write only what belongs to its piece; then the
// result is the same for any number of cores.
template <typename Body>
void InPieces(size_t count, const Body& body) {
  constexpr size_t kSmall = 1 << 16;
  const size_t cores = std::max(1u, std::thread::hardware_concurrency());
  const size_t pieces = count < kSmall ? 1 : std::min<size_t>(8, cores);
  std::vector<std::thread> helpers;
  for (size_t i = 1; i < pieces; ++i)
    helpers.emplace_back([&, i] { body(count * i / pieces, count * (i + 1) / pieces); });
  body(size_t{0}, count / pieces);
  for (std::thread& helper : helpers) helper.join();
}

}  // namespace touchstone::geometry
