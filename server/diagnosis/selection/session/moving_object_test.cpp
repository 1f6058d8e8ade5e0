#include "server/diagnosis/selection/session/moving_object.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

using testing::HasSubstr;

std::optional<MovingObject> MotionOf(const touches::SyntheticSet& set) {
  return FindMovingObject(set.observations, set.prediction, set.residuals);
}

// Each object moves by so much while it is touched; it is put back where it was for the next.
touches::SyntheticSet Moving(const Eigen::Vector3d& move_m, int rounds, uint64_t seed) {
  touches::SyntheticSet set = touches::TiltedSet(seed, rounds);
  std::vector<int> first(5, -1), last(5, -1);
  for (int k = 0; k < set.size(); ++k) {
    const int object = set.observations.object[k];
    if (first[object] < 0) first[object] = k;
    last[object] = k;
  }
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i) {
      const int object = set.observations.object[k];
      const double share = static_cast<double>(k - first[object]) / (last[object] - first[object]);
      set.observations.time_s[k * 3 + i] += touches::LaterBy(set, k, i, share * move_m);
    }
  set.Finish();
  return set;
}

TEST(MovingObject, IsFoundWithAndWithoutRepeats) {
  for (const int rounds : {1, 4}) {
    const auto found = MotionOf(Moving({0, 0.8e-3, 0}, rounds, 3));
    ASSERT_TRUE(found) << rounds;
    EXPECT_NEAR(found->moved_m, 0.8e-3, 0.15e-3);
    EXPECT_EQ(found->turned_rad, 0);
    EXPECT_THAT(found->words, HasSubstr("The object moves while it is touched, by 0."));
  }
}

TEST(MovingObject, IsNotFoundInNoise) {
  for (uint64_t seed = 0; seed < 40; ++seed)
    EXPECT_FALSE(MotionOf(Moving({0, 0, 0}, 1 + seed % 4, seed))) << seed;
}

// That one is put down anew: a step between rounds.
TEST(MovingObject, IsNoneThatIsPutDownAnewEachRound) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    touches::SyntheticSet set = touches::TiltedSet(seed);
    RandomStream random(seed, RandomDomain::kTest);
    std::vector<Eigen::Vector3d> moved_m(5 * 4);
    for (Eigen::Vector3d& move_m : moved_m)
      move_m = Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()) * 0.5e-3;
    for (int k = 0; k < set.size(); ++k)
      for (int i = 0; i < 3; ++i)
        set.observations.time_s[k * 3 + i] += touches::LaterBy(
            set, k, i, moved_m[set.observations.object[k] * 4 + set.observations.set->round[k]]);
    set.Finish();
    EXPECT_FALSE(MotionOf(set)) << seed;
  }
}

// From above, a finger that grows looks like an object that tilts.
TEST(MovingObject, IsNoFingerThatDrifts) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 9);
  auto from_above = std::make_shared<session::MeasurementSet>(*set.observations.set);
  for (int k = 0; k < set.size(); ++k) {
    from_above->approach[k] = -Eigen::Vector3d::UnitZ(), from_above->lateral[k] = Eigen::Vector3d::UnitX();
    for (int i = 0; i < 3; ++i) {
      set.prediction.normal[k * 3 + i] = Eigen::Vector3d::UnitZ();
      set.prediction.contact_m[k * 3 + i] = Eigen::Vector3d((i - 1) * 0.02, 0, 0);
      set.prediction.cos_incidence[k * 3 + i] = 1;
    }
    set.observations.time_s[k * 3] += 60e-3 * k / set.size();
  }
  set.observations.set = from_above;
  set.Finish();
  EXPECT_FALSE(MotionOf(set));
}

// Touches that go from one side to the other, with an error that depends on the side.
TEST(MovingObject, IsNoMisfitOfTouchesInTheOrderOfTheirPlaces) {
  touches::SyntheticSet set = touches::TiltedSet(11, 1);
  auto ordered = std::make_shared<session::MeasurementSet>(*set.observations.set);
  for (int k = 0; k < set.size(); ++k) {
    ordered->target_m[k] = Eigen::Vector3d(0, 0, 1e-3 * (k % 48));
    for (int i = 0; i < 3; ++i)
      set.observations.time_s[k * 3 + i] +=
          touches::LaterBy(set, k, i, {0, 0, 0.02 * ordered->target_m[k].z()});
  }
  set.observations.set = ordered;
  set.Finish();
  EXPECT_FALSE(MotionOf(set));
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
