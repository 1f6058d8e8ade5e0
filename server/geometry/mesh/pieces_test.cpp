#include "server/geometry/mesh/pieces.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>

namespace touchstone::geometry {
namespace {

TEST(Pieces, HoldEveryNumberOnce) {
  for (const size_t count : {0, 1, 65535, 65536, 65537, 1000003}) {
    std::vector<uint8_t> times(count);
    std::atomic<int> calls{0};
    InPieces(count, [&](size_t begin, size_t end) {
      ++calls;
      for (size_t k = begin; k < end; ++k) ++times[k];
    });
    EXPECT_EQ(std::count(times.begin(), times.end(), 1), static_cast<int64_t>(count));
    EXPECT_LE(calls, 8);
    if (count < 65536) {
      EXPECT_EQ(calls, 1) << "a small mesh is not worth a thread";
    }
  }
}

}  // namespace
}  // namespace touchstone::geometry
