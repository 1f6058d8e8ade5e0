#include "server/diagnosis/touches/same_poses.h"

#include <gtest/gtest.h>

#include "server/diagnosis/touches/prediction.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::touches {
namespace {

constexpr double kSigmaS = 0.002, kDegrees = 200;

// Sessions of the same poses, made by one rig (seed 1) and by another.
SamePoses Compared(const HiddenRig& one, const HiddenRig& other) {
  std::vector<Observations> observations;
  std::vector<std::vector<double>> residuals;
  for (const HiddenRig* rig : {&one, &other}) {
    auto made = MakeObservations(MakeTestInput(*rig));
    EXPECT_TRUE(made.ok()) << made.status();
    observations.push_back(*std::move(made));
    residuals.push_back(Residuals(
        observations.back(), *Predict(observations.back(), model::NominalModel(), false, false, nullptr)));
  }
  const auto of = [&](int s) { return PosedResiduals{&observations[s], &residuals[s], kSigmaS, kDegrees}; };
  return CompareSamePoses(of(0), of(1));
}

HiddenRig RigOf(uint64_t seed) {
  HiddenRig rig;
  rig.seed = seed;
  rig.pose_seed = 77;
  return rig;
}

TEST(SamePoses, OneRigAgreesWithItselfWhateverTheModelLacks) {
  HiddenRig monday = RigOf(1), friday = RigOf(2);
  monday.hidden = friday.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  const SamePoses same = Compared(monday, friday);
  EXPECT_GT(same.poses, 60);
  EXPECT_GT(same.p, 0.01);
  EXPECT_NEAR(same.rms_s / same.expected_s, 1, 0.15);
}

TEST(SamePoses, ARigThatChangedDiffers) {
  HiddenRig friday = RigOf(2);
  friday.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  EXPECT_LT(Compared(RigOf(1), friday).p, 1e-6);
}

TEST(SamePoses, OtherPosesAreNotCompared) {
  HiddenRig other = RigOf(2);
  other.pose_seed = 78;
  const SamePoses same = Compared(RigOf(1), other);
  EXPECT_EQ(same.poses, 0);
  EXPECT_EQ(same.p, 1);
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
