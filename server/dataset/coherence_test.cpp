#include "server/dataset/coherence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "server/touch/plan.h"

namespace touchstone::dataset {
namespace {

std::vector<touch::TouchPose> Poses(int count) {
  geometry::Bounds bounds;
  bounds.min_m = {-0.075, -0.075, -0.07};
  bounds.max_m = {0.075, 0.075, 0.07};
  touch::Plan plan;
  std::vector<uint64_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0);
  std::vector<touch::TouchPose> poses(count);
  touch::MakePoseGenerator(plan, bounds, 3)->Draw(numbers, 0, poses.data());
  return poses;
}

std::vector<uint32_t> Order(const std::vector<touch::TouchPose>& poses) {
  CoherentOrder order;
  order.Begin(absl::MakeConstSpan(poses).subspan(0, 100));
  order.Add(poses);
  const absl::Span<const uint32_t> sorted = order.Sort();
  return {sorted.begin(), sorted.end()};
}

TEST(CoherentOrder, IsAPermutation) {
  for (int count : {0, 1, 31, 32, 5000}) {
    const std::vector<touch::TouchPose> poses = Poses(count);
    std::vector<uint32_t> order = Order(poses);
    std::sort(order.begin(), order.end());
    for (int k = 0; k < count; ++k) ASSERT_EQ(order[k], static_cast<uint32_t>(k));
  }
}

TEST(CoherentOrder, BringsNeighboursTogether) {
  const std::vector<touch::TouchPose> poses = Poses(20000);
  std::vector<uint32_t> order = Order(poses);
  double before = 0, after = 0;
  for (size_t k = 1; k < poses.size(); ++k) {
    before += (poses[k].approach - poses[k - 1].approach).norm();
    after += (poses[order[k]].approach - poses[order[k - 1]].approach).norm();
  }
  EXPECT_LT(after, before / 20);
}

TEST(CoherentOrder, TakesEqualPosesInTheirOrder) {
  const std::vector<touch::TouchPose> poses(100);
  std::vector<uint32_t> order = Order(poses);
  for (uint32_t k = 0; k < 100; ++k) EXPECT_EQ(order[k], k);
}

}  // namespace
}  // namespace touchstone::dataset
