// The order of a rig's touches, and their noise.
#include "client/source/plans/rig_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

MeasuredTouch Touch(uint64_t number, const std::string& object, double x_m = 0) {
  MeasuredTouch touch;
  touch.touch = number;
  touch.object = object;
  touch.commanded.mutable_target_m()->set_x(x_m);
  touch.commanded.mutable_approach()->set_z(-1);
  touch.commanded.mutable_lateral()->set_x(1);
  touch.commanded.set_standoff_m(0.06);
  touch.commanded.set_speed_m_s(0.02);
  return touch;
}

PlannedRow Row(uint64_t number, const std::string& object, const std::string& up_face) {
  PlannedRow row;
  row.touch = Touch(number, object);
  row.up_face = up_face;
  row.duration_s = 2;
  return row;
}

bool All(size_t) {
  return true;
}

// Two rounds over two objects, each with two faces, one after the other as plans have them.
std::vector<PlannedRow> TwoRounds() {
  std::vector<PlannedRow> rows;
  for (int round = 0; round < 2; ++round)
    for (const char* object : {"a", "b"})
      for (const char* face : {"+x", "+z"}) rows.push_back(Row(rows.size(), object, face));
  return rows;
}

TEST(RigPlan, PutsEveryObjectDownOnceForEachOfItsFaces) {
  const std::vector<RigGroup> groups = GroupRows(TwoRounds(), All, "", "");
  ASSERT_EQ(groups.size(), 4u);
  EXPECT_EQ(groups[0].object + groups[0].up_face, "a+x");
  EXPECT_EQ(groups[1].object + groups[1].up_face, "a+z");
  EXPECT_EQ(groups[2].object + groups[2].up_face, "b+x");
  EXPECT_EQ(groups[3].object + groups[3].up_face, "b+z");
  EXPECT_THAT(groups[0].rows, ElementsAre(0, 4)) << "rounds keep the plan's order";
  EXPECT_THAT(groups[3].rows, ElementsAre(3, 7));
  EXPECT_DOUBLE_EQ(groups[0].duration_s, 4);
}

TEST(RigPlan, BeginsWithWhatLiesOnTheFixture) {
  const std::vector<RigGroup> groups = GroupRows(TwoRounds(), All, "b", "+z");
  ASSERT_EQ(groups.size(), 4u);
  EXPECT_EQ(groups[0].object + groups[0].up_face, "b+z");
  EXPECT_EQ(groups[1].object + groups[1].up_face, "b+x") << "it is turned before it is taken away";
  EXPECT_EQ(groups[2].object + groups[2].up_face, "a+x");
}

TEST(RigPlan, LeavesOutWhatIsDone) {
  const std::vector<RigGroup> groups = GroupRows(
      TwoRounds(), [](size_t row) { return row >= 5; }, "", "");
  ASSERT_EQ(groups.size(), 3u);
  EXPECT_THAT(groups[0].rows, ElementsAre(5));
}

TEST(RigPlan, NumbersAreUniqueForAnObject) {
  EXPECT_TRUE(RowsOf({Touch(0, "a"), Touch(0, "b"), Touch(1, "a")}, "monday", "plan.csv").ok());
  const auto twice = RowsOf({Touch(0, "a"), Touch(0, "a")}, "monday", "plan.csv");
  EXPECT_EQ(twice.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(twice.status().message()), HasSubstr("plan.csv: touch 0 of a stands twice"));
}

TEST(RigPlan, TellsAPersonWhatToDo) {
  EXPECT_EQ(RestingFaceRequest("lat20", "-x", ""), "Put lat20 on the fixture with its face -x up");
  EXPECT_EQ(RestingFaceRequest("lat20", "-x", "lat00"), "Put lat20 on the fixture with its face -x up");
  EXPECT_EQ(RestingFaceRequest("lat20", "-x", "lat20"), "Turn lat20 so that its face -x points up");
}

TEST(NoiseOfRepeats, IsThatOfOneFinger) {
  constexpr double kSigmaS = 50e-6;
  RandomStream random(7, RandomDomain::kTest);
  std::vector<MeasuredTouch> touches;
  for (int repeat = 0; repeat < 400; ++repeat)
    for (int pose = 0; pose < 3; ++pose) {
      MeasuredTouch touch = Touch(touches.size(), "a", 0.01 * pose);
      touch.commanded.set_session_time_s(touches.size());
      // The whole touch comes earlier or later, which is no noise of a finger.
      const double start_s = 1 + 0.01 * random.Normal();
      for (int finger = 0; finger < 3; ++finger)
        touch.time_s.push_back(start_s + 1e-3 * finger * pose + kSigmaS * random.Normal());
      touches.push_back(touch);
    }
  // 2400 degrees of freedom: 1.4 % standard error.
  EXPECT_NEAR(NoiseOfRepeats(touches), kSigmaS, 0.05 * kSigmaS);
}

TEST(NoiseOfRepeats, IsUnknownWithoutRepeatsAndIgnoresMisses) {
  MeasuredTouch a = Touch(0, "a"), b = Touch(1, "a", 0.01);
  a.time_s = {1, 2, 3};
  b.time_s = {1, 2, 4};
  EXPECT_TRUE(std::isnan(NoiseOfRepeats({a, b})));
  b = a;
  b.time_s[1] = NAN;
  EXPECT_TRUE(std::isnan(NoiseOfRepeats({a, b})));
}

// The tip's frame has z along the approach and x along the fingers.
TEST(TaughtTouch, TouchesWhereTheTipIsAlongItsAxis) {
  v1::GuideState state;
  EXPECT_FALSE(TaughtTouch(state, 0, 0.06, 0.02).ok()) << "nothing lies on the fixture";
  state.set_object("lat20");
  v1::BasePose& pose = *state.mutable_object_from_tip();
  pose.mutable_position_m()->set_x(0.01), pose.mutable_position_m()->set_z(0.07);
  pose.mutable_rotation_rad()->set_x(3.14159265358979);  // looks down
  const auto touch = TaughtTouch(state, 4, 0.05, 0.03);
  ASSERT_TRUE(touch.ok()) << touch.status();
  EXPECT_EQ(touch->touch, 4u);
  EXPECT_EQ(touch->object, "lat20");
  EXPECT_NEAR(touch->commanded.target_m().x(), 0.01, 1e-12);
  EXPECT_NEAR(touch->commanded.approach().z(), -1, 1e-9);
  EXPECT_NEAR(touch->commanded.lateral().x(), 1, 1e-9);
  EXPECT_EQ(touch->commanded.standoff_m(), 0.05);
  EXPECT_EQ(touch->commanded.speed_m_s(), 0.03);
}

}  // namespace
}  // namespace touchstone::client
