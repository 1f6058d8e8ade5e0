#include "client/source/plans/rig_words.h"

#include <gtest/gtest.h>

namespace touchstone::client {
namespace {

TEST(RigWords, AreTheNamesWithoutThoseOfTheirEnums) {
  EXPECT_EQ(SourceStateWord(v1::SOURCE_STATE_SAFEGUARD_STOP), "safeguard_stop");
  EXPECT_EQ(RobotModeWord(v1::ROBOT_MODE_NO_CONTROLLER), "NO_CONTROLLER");
  EXPECT_EQ(SafetyModeWord(v1::SAFETY_MODE_NORMAL), "NORMAL");
  EXPECT_EQ(CameraKindWord(v1::CAMERA_KIND_FOLDER), "folder");
  EXPECT_EQ(MotionPhaseWord(v1::MOTION_PHASE_APPROACH), "approach");
}

TEST(RigWords, ANumberWithoutANameIsShownAsItIs) {
  EXPECT_EQ(RobotModeWord(static_cast<v1::RobotMode>(12)), "12");
  EXPECT_EQ(UpFaceWord(static_cast<v1::UpFace>(9)), "");
}

TEST(RigWords, FacesReadBack) {
  for (int face = v1::UP_FACE_PLUS_X; face <= v1::UP_FACE_MINUS_Z; ++face)
    EXPECT_EQ(UpFaceOf(UpFaceWord(static_cast<v1::UpFace>(face))), face);
  EXPECT_EQ(UpFaceOf("up"), v1::UP_FACE_UNSPECIFIED);
}

}  // namespace
}  // namespace touchstone::client
