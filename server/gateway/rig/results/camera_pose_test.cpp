#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/gateway/rig/results/camera_pose.h"

namespace touchstone::gateway {
namespace {

const Eigen::Isometry3d kTipFromCamera = Eigen::Translation3d(0.05, 0, -0.12) *
                                         Eigen::Isometry3d(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()));
const Eigen::Isometry3d kBaseFromCamera =
    Eigen::Translation3d(0.3, 0.1, 0.4) * Eigen::Isometry3d(Eigen::AngleAxisd(3, Eigen::Vector3d::UnitX()));

// A state whose camera stands off the commanded pose by a shift in its own frame and a turn about its own x.
arm::ArmState StateOff(const Eigen::Vector3d& shift_m, double turn_rad) {
  arm::ArmState state;
  state.base_from_tip = kBaseFromCamera * Eigen::Translation3d(shift_m) *
                        Eigen::Isometry3d(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitX())) *
                        kTipFromCamera.inverse();
  return state;
}

TEST(CameraPose, IsTheMeanOfTheStatesAndTellsTheWorst) {
  const auto pose = MeasureCameraPose({StateOff({1e-4, 0, 0}, 2e-4), StateOff({3e-4, 0, 0}, 4e-4)},
                                      kTipFromCamera, kBaseFromCamera, {});
  ASSERT_TRUE(pose.ok()) << pose.status();
  const Eigen::Isometry3d off = kBaseFromCamera.inverse() * pose->base_from_camera;
  EXPECT_NEAR((off.translation() - Eigen::Vector3d(2e-4, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR(Eigen::AngleAxisd(off.rotation()).angle(), 3e-4, 1e-9);
  EXPECT_NEAR(pose->deviation_m, 3e-4, 1e-12);
  EXPECT_NEAR(pose->deviation_rad, 4e-4, 1e-9);
}

TEST(CameraPose, OneStateFartherThanTheToleranceRefusesThePictureWithBothNumbers) {
  for (const auto& [shift_m, turn_rad, words] :
       {std::tuple(6e-4, 0.0, "0.6 mm and"), std::tuple(0.0, 3.5e-3, "0.201 deg from"),
        std::tuple(0.25, 0.0, "250 mm")}) {
    const auto pose = MeasureCameraPose({StateOff({0, 0, 0}, 0), StateOff({0, shift_m, 0}, turn_rad)},
                                        kTipFromCamera, kBaseFromCamera, {});
    ASSERT_EQ(pose.status().code(), absl::StatusCode::kFailedPrecondition) << words;
    EXPECT_THAT(
        std::string(pose.status().message()),
        testing::AllOf(testing::HasSubstr(words), testing::HasSubstr("0.5 mm and 0.1 deg are allowed")));
  }
  EXPECT_TRUE(
      MeasureCameraPose({StateOff({0, 6e-4, 0}, 0)}, kTipFromCamera, kBaseFromCamera, {0.001, 0.001}).ok());
}

TEST(CameraPose, WithoutAnyStateItIsUnknown) {
  EXPECT_EQ(MeasureCameraPose({}, kTipFromCamera, kBaseFromCamera, {}).status().code(),
            absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace touchstone::gateway
