// Every effect of the catalogue against a closed form, on a plate that the rig meets at an angle.
#include "tests/hidden_effects/generator/rig.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>

namespace touchstone::hidden {
namespace {

using Vec = Eigen::Vector3d;

constexpr double kTilt = 0.2, kSpeed = 20, kDegree = M_PI / 180;
const double kTan = std::tan(kTilt), kCos = std::cos(kTilt);

Scenario Plate(std::vector<Hidden> hidden) {
  Scenario scenario;
  scenario.objects = {std::make_shared<Solid>(
      "plate",
      Triangles{{{-500, -500, 0}, {500, -500, 0}, {500, 500, 0}, {-500, 500, 0}}, {{0, 1, 2}, {0, 2, 3}}})};
  scenario.hidden = std::move(hidden);
  return scenario;
}

// From 60 mm above, the row of fingers up the slope: finger i travels 60 + x_i tan(tilt).
Command Tilted() {
  Command command;
  command.target_mm = Vec(10, 20, 0);
  command.approach = Vec(std::sin(kTilt), 0, -std::cos(kTilt));
  command.lateral = Vec(std::cos(kTilt), 0, std::sin(kTilt));
  return command;
}

constexpr double kX[] = {-30, 0, 30};
double Nominal(int i) {
  return (60 + kX[i] * kTan) / kSpeed;
}

// Reported times; `before`: a touch that came before.
std::vector<double> Times(std::vector<Hidden> hidden, double session_time_s = 0, bool before = false,
                          const Command& command = Tilted()) {
  Rig rig(Plate(std::move(hidden)), 1);
  if (before) rig.Touch(command, kSpeed, session_time_s, 23);
  std::vector<double> out;
  for (const auto& finger : rig.Touch(command, kSpeed, session_time_s, 23))
    out.push_back(finger.reported_s * rig.clock_factor());
  return out;
}

// Checks the times of all three fingers.
template <typename Expected>
void Expect(const std::vector<double>& times, Expected expected, double tolerance_s = 1e-9) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(times[i], expected(i), tolerance_s) << "finger " << i;
}

TEST(HiddenRig, WithNothingHiddenMeetsThePlaneByTheClosedForm) {
  Expect(Times({}), Nominal);
}

TEST(HiddenRig, PoseEffectsHaveTheirClosedForms) {
  Expect(Times({{"tool_yaw", {10}}}),
         [](int i) { return (60 + kX[i] * std::cos(10 * kDegree) * kTan) / kSpeed; });
  Expect(Times({{"tool_tilt", {2}}}),
         [](int i) { return Nominal(i) + kX[i] * std::tan(2 * kDegree) / kSpeed; });
  Expect(Times({{"finger_spacing", {1.5}}}), [](int i) { return (60 + kX[i] * 1.05 * kTan) / kSpeed; });
  const double offsets[] = {0.2, -0.3, 0.1};
  Expect(Times({{"finger_length", {0.2, -0.3, 0.1}}}),
         [&](int i) { return Nominal(i) + offsets[i] / kSpeed; });
  // Lower tips meet the plane earlier.
  Expect(Times({{"gravity_sag", {0.5}}}), [](int i) { return Nominal(i) - 0.5 / kCos / kSpeed; });
  // The plane goes through the origin, so its size changes nothing.
  Expect(Times({{"object_scale", {0.05}}}), Nominal);
  // Higher by 1 mm: earlier. Turned about y by the tilt: square to the approach.
  Expect(Times({{"object_pose", {0, 0, 1, 0, 0, 0}}}), [](int i) { return Nominal(i) - 1 / kCos / kSpeed; });
  const auto square = Times({{"object_pose", {0, 0, 0, 0, -kTilt / kDegree, 0}}});
  EXPECT_NEAR(square[0], square[2], 1e-9);
}

TEST(HiddenRig, AYawTurnsTheRowByTheRightHandRule) {
  // Along -z over a plane that rises with y: turning x by +90 degrees about -z gives -y.
  Scenario scenario = Plate({{"tool_yaw", {90}}});
  Command command;
  command.target_mm = Vec::Zero(), command.approach = -Vec::UnitZ(), command.lateral = Vec::UnitX();
  scenario.hidden.push_back({"object_pose", {0, 0, 0, kTilt / kDegree, 0, 0}});
  const auto fingers = Rig(scenario, 1).Touch(command, kSpeed, 0, 23);
  EXPECT_NEAR(fingers[2].time_s, (60 + 30 * kTan) / kSpeed, 1e-9);
}

TEST(HiddenRig, AnObjectGrowsAboutTheOriginOfItsMesh) {
  Scenario scenario = Plate({{"object_scale", {0.01}}});
  scenario.objects = {std::make_shared<Solid>(
      "ledge", Triangles{{{-500, -500, 100}, {500, -500, 100}, {500, 500, 100}, {-500, 500, 100}},
                         {{0, 1, 2}, {0, 2, 3}}})};
  Command command;
  command.target_mm = Vec(0, 0, 100), command.approach = -Vec::UnitZ(), command.lateral = Vec::UnitX();
  EXPECT_NEAR(Rig(scenario, 1).Touch(command, kSpeed, 0, 23)[0].time_s, (60 - 1) / kSpeed, 1e-9);
}

TEST(HiddenRig, ContactEffectsHaveTheirClosedForms) {
  Expect(Times({{"tip_radius", {2}}}), [](int i) { return Nominal(i) - 2 * (1 / kCos - 1) / kSpeed; });
  // Bumps much longer than the row of fingers lift all of them equally, and never by much more than their RMS.
  const auto bumpy = Times({{"surface_error", {0.1, 1e6}}});
  EXPECT_NEAR(bumpy[0] - Nominal(0), bumpy[2] - Nominal(2), 1e-6);
  EXPECT_GT(std::abs(bumpy[0] - Nominal(0)), 1e-6);
  EXPECT_LT(std::abs(bumpy[0] - Nominal(0)), 5 * 0.1 / kCos / kSpeed);
}

TEST(HiddenRig, MotionEffectsHaveTheirClosedForms) {
  Expect(Times({{"speed_error", {0.1}}}), [](int i) { return Nominal(i) / 1.1; });
  // 20 mm/s at 4 mm/s2: the ramp is 50 mm long, so the first finger is still on it.
  Expect(Times({{"acceleration_ramp", {4}}}), [](int i) {
    const double d = Nominal(i) * kSpeed;
    return d < 50 ? std::sqrt(2 * d / 4) : d / kSpeed + kSpeed / (2 * 4);
  });
  Expect(Times({{"acceleration_ramp", {3.5}}}), [](int i) {
    const double d = Nominal(i) * kSpeed, ramp = 400 / 7.0;
    return d < ramp ? std::sqrt(2 * d / 3.5) : d / kSpeed + kSpeed / 7;
  });
  Expect(Times({{"contact_slowdown", {0.2}}}),
         [](int i) { return Nominal(0) + (Nominal(i) - Nominal(0)) / 0.8; });
  Expect(Times({{"object_push", {0.3}}}), [](int i) { return Nominal(i) + (i > 0 ? 0.3 / kSpeed : 0); });
}

TEST(HiddenRig, SensorEffectsHaveTheirClosedForms) {
  Expect(Times({{"oblique_slip", {0.4}}}), [](int i) { return Nominal(i) + 0.4 * kTan / kSpeed; });
  const double late_us[] = {2000, -500, -1500};
  Expect(Times({{"channel_latency", {2000, -500, -1500}}}),
         [&](int i) { return Nominal(i) + late_us[i] * 1e-6; });
  const double rates[] = {0.1, -0.3, 0.2};
  Expect(Times({{"thermal_drift", {0.1, -0.3, 0.2}}}, 1800),
         [&](int i) { return Nominal(i) + 0.5 * rates[i] / kSpeed; });
  // The finger that waited longest for the last one of the touch before comes earliest.
  Expect(Times({{"return_hysteresis", {0.1}}}, 0, true),
         [](int i) { return Nominal(i) - 0.1 * (Nominal(2) - Nominal(i)); });
  Expect(Times({{"clock_skew", {0.01}}}), [](int i) { return 1.01 * Nominal(i); });
}

TEST(HiddenRig, TravelAddedByTheSensorTakesTheSpeedOfTheContact) {
  Expect(Times({{"oblique_slip", {0.4}}, {"contact_slowdown", {0.5}}}), [](int i) {
    return Nominal(0) + 2 * (Nominal(i) - Nominal(0)) + 0.4 * kTan / kSpeed * (i > 0 ? 2 : 1);
  });
}

}  // namespace
}  // namespace touchstone::hidden
