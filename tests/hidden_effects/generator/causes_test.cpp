// Causes outside the catalogue against closed forms, on a plate that the rig meets at an angle, and noise with memory
// against its moments.
#include "tests/hidden_effects/generator/causes.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>

#include "tests/hidden_effects/generator/generate.h"
#include "tests/hidden_effects/generator/rig.h"

namespace touchstone::hidden {
namespace {

constexpr double kLean = 0.4, kPace = 20, kLater = 700;

// Two plates of the same shape, so that a cause may act on one of them.
Scenario TwoPlates(std::vector<Cause> causes) {
  Scenario scenario;
  const Triangles plate{{{-500, -500, 0}, {500, -500, 0}, {500, 500, 0}, {-500, 500, 0}},
                        {{0, 1, 2}, {0, 2, 3}}};
  for (const char* name : {"one", "other"}) scenario.objects.push_back(std::make_shared<Solid>(name, plate));
  scenario.causes = std::move(causes);
  return scenario;
}

// From 60 mm above, the row of fingers up the slope: finger i travels 60 + x_i tan(lean).
Command Leaning(int object = 0) {
  Command command;
  command.object = object, command.target_mm = {10, 20, 0};
  command.approach = {std::sin(kLean), 0, -std::cos(kLean)};
  command.lateral = {std::cos(kLean), 0, std::sin(kLean)};
  return command;
}

// What a cause adds to the travel of the fingers, mm.
std::vector<double> Added(const Cause& cause, const Command& command = Leaning(), double time_s = kLater) {
  Rig with(TwoPlates({cause}), 1), without(TwoPlates({}), 1);
  const auto changed = with.Touch(command, kPace, time_s, 23),
             plain = without.Touch(command, kPace, time_s, 23);
  std::vector<double> out;
  for (int i = 0; i < 3; ++i) out.push_back(kPace * (changed[i].reported_s - plain[i].reported_s));
  return out;
}

void ExpectAdded(const std::vector<double>& added, double l, double m, double r) {
  EXPECT_NEAR(added[0], l, 1e-9);
  EXPECT_NEAR(added[1], m, 1e-9);
  EXPECT_NEAR(added[2], r, 1e-9);
}

TEST(HiddenCause, AWaveGoesWithTheTimeOfTheSession) {
  const double now = 0.2 * std::sin(2 * M_PI * kLater / 1200 + 0.5);
  ExpectAdded(Added({CauseKind::kSessionWave, 0.2, {1200, 0.5}, {1, 0, -1}}), now, 0, -now);
}

TEST(HiddenCause, AWarmUpLevelsOff) {
  const Cause warm_up{CauseKind::kWarmUp, 0.35, {600}, {1, 0, 0}};
  ExpectAdded(Added(warm_up), 0.35 * (1 - std::exp(-7.0 / 6)), 0, 0);
  ExpectAdded(Added(warm_up, Leaning(), 0), 0, 0, 0);
  ExpectAdded(Added(warm_up, Leaning(), 1e6), 0.35, 0, 0);
}

TEST(HiddenCause, AnOffsetBeginsInMidSession) {
  const Cause offset{CauseKind::kMidSession, 0.25, {kLater}, {0, 1, 0}};
  ExpectAdded(Added(offset, Leaning(), kLater - 1), 0, 0, 0);
  ExpectAdded(Added(offset), 0, 0.25, 0);
}

TEST(HiddenCause, AWaveInIncidenceBeginsAtItsAngle) {
  const double here = 0.3 * std::sin(40 * kLean);
  ExpectAdded(Added({CauseKind::kIncidenceWave, 0.3, {40, 20}, {}}), here, here, here);
  ExpectAdded(Added({CauseKind::kIncidenceWave, 0.3, {40, 25}, {}}), 0, 0, 0);
}

TEST(HiddenCause, AnInnerFingerIsDraggedByTheDifferenceOfItsNeighbours) {
  ExpectAdded(Added({CauseKind::kFingerCoupling, 0.02, {}, {}}), 0, -0.02 * 60 * std::tan(kLean), 0);
}

TEST(HiddenCause, OneObjectAloneSlipsOrIsPushed) {
  const Cause slip{CauseKind::kSlipOnOneObject, 0.5, {1}, {}},
      push{CauseKind::kPushOnOneObject, 0.3, {1}, {}};
  const double slid = 0.5 * std::tan(kLean);
  ExpectAdded(Added(slip, Leaning(0)), 0, 0, 0);
  ExpectAdded(Added(slip, Leaning(1)), slid, slid, slid);
  ExpectAdded(Added(push, Leaning(0)), 0, 0, 0);
  ExpectAdded(Added(push, Leaning(1)), 0, 0.3, 0.3);
}

TEST(HiddenCause, InOneRoundAloneObjectsSlipOrArePushed) {
  const Cause slip{CauseKind::kSlipInOneRound, 0.5, {2}, {}}, push{CauseKind::kPushInOneRound, 0.3, {2}, {}};
  Command command = Leaning();
  command.round = 1;
  ExpectAdded(Added(slip, command), 0, 0, 0);
  ExpectAdded(Added(push, command), 0, 0, 0);
  command.round = 2;
  const double slid = 0.5 * std::tan(kLean);
  ExpectAdded(Added(slip, command), slid, slid, slid);
  ExpectAdded(Added(push, command), 0, 0.3, 0.3);
}

TEST(HiddenCause, AnObjectStandsElsewhereInEachRound) {
  const Cause remounted{CauseKind::kRemounted, 0.4, {1}, {}};
  Command command = Leaning();
  command.pose = 3;
  for (const int round : {0, 1}) {
    command.round = round;
    // Of a plate only the height of its middle matters, and every finger feels the same of it.
    const double up = PlacementOf(remounted, 1, 0, round).moved_mm.z();
    const double shift = -up / std::cos(kLean);
    ExpectAdded(Added(remounted, command), shift, shift, shift);
  }
  EXPECT_NE(PlacementOf(remounted, 1, 0, 0).moved_mm, PlacementOf(remounted, 1, 0, 1).moved_mm);
  EXPECT_NE(PlacementOf(remounted, 1, 0, 0).moved_mm, PlacementOf(remounted, 1, 1, 0).moved_mm);
  // One rig that meets the pose in one round after the other remembers neither for the other.
  Rig rig(TwoPlates({remounted}), 1);
  command.round = 0;
  const double first = rig.Touch(command, kPace, 0, 23)[0].time_s;
  command.round = 1;
  EXPECT_NE(rig.Touch(command, kPace, 0, 23)[0].time_s, first);
  command.round = 0;
  EXPECT_EQ(rig.Touch(command, kPace, 0, 23)[0].time_s, first);
}

TEST(HiddenCause, APoseKeepsItsTilt) {
  const Cause error{CauseKind::kPoseError, 0.1, {}, {}};
  Command command = Leaning();
  double squares = 0;
  for (int pose = 0; pose < 400; ++pose) {
    command.pose = pose;
    const auto added = Added(error, command);
    // The angle between the row and the surface: its tangent is what the outer fingers show, per 30 mm. A plate is
    // met at the distance of the target, turned by the tilt in the plane of row and approach.
    const Eigen::Matrix3d rotated = TiltOf(error, 1, pose, command.approach, command.lateral);
    const Eigen::Vector3d a = rotated * command.approach, s = rotated * command.lateral;
    const double slope = -s.z() / a.z();  // of travel along the row
    EXPECT_NEAR(added[2] - added[0], 60 * (slope - std::tan(kLean)), 1e-9);
    squares += std::pow((added[2] - added[0]) / 60 * std::pow(std::cos(kLean), 2), 2);
    EXPECT_EQ(Added(error, command), added);
  }
  // 0.1 degrees of tilt, turned about the row's normal.
  EXPECT_NEAR(std::sqrt(squares / 400), 0.1 * M_PI / 180, 0.15 * 0.1 * M_PI / 180);
}

TEST(HiddenCause, NoiseWithMemoryHasItsSizeAndItsCorrelation) {
  std::vector<double> times;
  for (int k = 0; k < 40'000; ++k) times.push_back(9.0 * k);
  const auto added = AddedNoiseUs({CauseKind::kNoiseWithMemory, 7000, {60}, {}}, 3, times, 2);
  double variance = 0, neighbours = 0, across = 0;
  for (size_t k = 1; k < times.size(); ++k) {
    variance += added[2 * k] * added[2 * k];
    neighbours += added[2 * k] * added[2 * k - 2];
    across += added[2 * k] * added[2 * k + 1];
  }
  EXPECT_NEAR(std::sqrt(variance / times.size()), 7000, 300);
  EXPECT_NEAR(neighbours / variance, std::exp(-9.0 / 60), 0.02);
  EXPECT_NEAR(across / variance, 0, 0.06);
}

TEST(HiddenCause, AWalkSpreadsWithTheSquareRootOfTime) {
  double squares = 0;
  for (int seed = 0; seed < 2000; ++seed)
    squares +=
        std::pow(AddedNoiseUs({CauseKind::kRandomWalk, 5000, {}, {}}, seed, {0, 900, 1800, 3600}, 1)[3], 2);
  EXPECT_NEAR(std::sqrt(squares / 2000), 5000, 250);
}

TEST(HiddenCause, NoiseWithMemoryLeavesTheOtherNoiseAsItIs) {
  Scenario plain = TwoPlates({}), walking = TwoPlates({{CauseKind::kRandomWalk, 5000, {}, {}}});
  std::vector<Command> commands(20, Leaning());
  const Set without = GenerateFor(plain, commands, 5), with = GenerateFor(walking, commands, 5);
  const auto added = AddedNoiseUs(walking.causes[0], 5, with.session_time_s, 3);
  EXPECT_EQ(with.exact_time_us, without.exact_time_us);
  for (size_t k = 0; k < added.size(); ++k)
    EXPECT_NEAR(with.reported_us[k] - without.reported_us[k], added[k], 1e-3);
}

}  // namespace
}  // namespace touchstone::hidden
