#include "server/gateway/arm/motion/ur_script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/units.h"

namespace touchstone::gateway::arm {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Eigen::Isometry3d Down(double x_m, double z_m) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(x_m, 0, z_m);
  return pose;
}

ArmTouch SomeTouch() {
  ArmTouch touch;
  touch.program_id = 17;
  touch.transit = {Down(0.3, 0.3), Down(0.3, 0.2)};
  touch.end = Down(0.3, 0.1);
  touch.speed_m_s = 0.02;
  return touch;
}

// UR takes the tool centre point for a centre of gravity that set_payload does not name.
TEST(TouchProgram, NeverLeavesTheCentreOfGravityToTheTool) {
  ScriptOptions options;
  const std::string text = TouchProgram(SomeTouch(), {0.25, 0.2, 0.15}, options);
  EXPECT_THAT(text, HasSubstr("  set_payload_mass(0.5)\n"));
  EXPECT_THAT(text, Not(HasSubstr("set_payload(")));
}

// Byte for byte: what the controller gets is part of the interface.
TEST(TouchProgram, ReadsAsItDoes) {
  ScriptOptions options;
  options.flange_from_tip.translation().z() = 0.12;
  options.payload_cog_m = Eigen::Vector3d(0, 0.01, 0.045);
  const std::string expected =
      "def touch_17():\n"
      "  rtde_set_watchdog(\"input_int_register_24\", 4, \"stop\")\n"
      "  set_tcp(p[0,0,0.12,0,0,0])\n"
      "  set_payload(0.5, [0,0.01,0.045])\n"
      "  write_output_integer_register(25, 0)\n"
      "  write_output_integer_register(24, 17)\n"
      "  while read_input_integer_register(25) != 71:\n"
      "    sync()\n"
      "  end\n"
      "  write_output_integer_register(25, 1)\n"
      "  movel(p[0.3,0,0.3,3.14159265,0,0], a=1.2, v=0.25)\n"
      "  movel(p[0.3,0,0.2,3.14159265,0,0], a=1.2, v=0.2)\n"
      "  write_output_integer_register(25, 2)\n"
      "  while read_input_integer_register(25) != 69:\n"
      "    sync()\n"
      "  end\n"
      "  global approaching = True\n"
      "  thread approach():\n"
      "    movel(p[0.3,0,0.1,3.14159265,0,0], a=1.2, v=0.02)\n"
      "    approaching = False\n"
      "  end\n"
      "  write_output_integer_register(25, 3)\n"
      "  handle = run approach()\n"
      "  while approaching and read_input_integer_register(25) != 70:\n"
      "    sync()\n"
      "  end\n"
      "  kill handle\n"
      "  stopl(1.2)\n"
      "  write_output_integer_register(25, 4)\n"
      "  movel(p[0.3,0,0.2,3.14159265,0,0], a=1.2, v=0.15)\n"
      "  write_output_integer_register(25, 5)\n"
      "end\n";
  EXPECT_EQ(TouchProgram(SomeTouch(), {0.25, 0.2, 0.15}, options), expected);
}

TEST(TouchProgram, NameFitsTheControllersThirtyOneCharacters) {
  ArmTouch touch = SomeTouch();
  touch.program_id = (1u << 28) - 1;
  const std::string text = TouchProgram(touch, {0.25, 0.25, 0.25}, ScriptOptions());
  EXPECT_LE(text.find('(') - 4, 31u);
  EXPECT_THAT(text, HasSubstr(std::to_string(4 * ((1 << 28) - 1) + 1)));
}

TEST(TouchProgram, WatchdogIsSlowerOnAnAcceleratedClock) {
  ScriptOptions options;
  options.time_scale = 8;
  EXPECT_THAT(TouchProgram(SomeTouch(), {0.25, 0.2, 0.15}, options),
              HasSubstr("\"input_int_register_24\", 0.5, "));
}

TEST(MoveProgram, EndsWithTheJoints) {
  const std::string text =
      MoveProgram(5, {Down(0.3, 0.3)}, {0.25}, {{{0, -1.5, 0.25, 0, 1, 0}}}, {0.8}, ScriptOptions());
  EXPECT_THAT(text, HasSubstr("def move_5():\n"));
  EXPECT_THAT(
      text,
      HasSubstr("  movej([0,-1.5,0.25,0,1,0], a=1.4, v=0.8)\n  write_output_integer_register(25, 5)\nend\n"));
}

TEST(FreedriveProgram, UsesTheWordsOfItsSeriesAndEndsThemByCommand) {
  const std::string e_series = FreedriveProgram(7, true, ScriptOptions());
  EXPECT_THAT(e_series, HasSubstr("  freedrive_mode()\n"));
  EXPECT_THAT(e_series, HasSubstr("  end_freedrive_mode()\n"));
  EXPECT_THAT(e_series, HasSubstr("rtde_set_watchdog"));
  EXPECT_LT(e_series.find("freedrive_mode()"), e_series.find("!= 30"))
      << "waits for the command while it is free";
  const std::string cb3 = FreedriveProgram(7, false, ScriptOptions());
  EXPECT_THAT(cb3, HasSubstr("  teach_mode()\n"));
  EXPECT_THAT(cb3, HasSubstr("  end_teach_mode()\n"));
  EXPECT_EQ(cb3.find("freedrive"), std::string::npos);
}

TEST(LineSpeed, IsSlowerWhereTheToolTurnsMuchOnAShortWay) {
  const Eigen::Isometry3d from = Down(0.3, 0.3);
  Eigen::Isometry3d to = Down(0.31, 0.3);
  EXPECT_DOUBLE_EQ(LineSpeed(from, to, 0.25), 0.25);
  to.linear() = to.linear() * Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ());
  const double slow_m_s = LineSpeed(from, to, 0.25);
  EXPECT_NEAR(0.01 / slow_m_s, (kPi / 2) / kMaxTurnRadS, 1e-6);
  EXPECT_GE(LineDuration(from, to, 0.25, 1.2), (kPi / 2) / kMaxTurnRadS - 1e-9);
}

TEST(LineDuration, IsThatOfATrapezoid) {
  EXPECT_NEAR(LineDuration(Down(0.3, 0.3), Down(0.3, 0.2), 0.25, 1.25), 0.1 / 0.25 + 0.25 / 1.25, 1e-9);
  EXPECT_NEAR(LineDuration(Down(0.3, 0.3), Down(0.3, 0.29), 0.25, 1), 2 * std::sqrt(0.01), 1e-9)
      << "never at full speed";
}

}  // namespace
}  // namespace touchstone::gateway::arm
