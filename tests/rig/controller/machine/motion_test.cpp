#include <atomic>
#include <cmath>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "tests/rig/controller/machine/machine.h"
#include "tests/rig/controller/machine/motion.h"
#include "tests/rig/controller/network/net.h"

namespace touchstone::rig {
namespace {

Joints Home() {
  return (Joints() << 0, -1.5708, -1.5708, -1.5708, 1.5708, 0).finished();
}

TEST(SpeedProfile, IsATrapezoidInClosedForm) {
  const SpeedProfile profile(10, 0.5, 0.25, 1.2);
  const double ramp_s = 0.25 / 1.2, ramp = 0.25 * ramp_s / 2;
  EXPECT_EQ(profile.LengthAt(9), 0);
  EXPECT_NEAR(profile.LengthAt(10 + ramp_s / 2), ramp / 4, 1e-15);
  EXPECT_NEAR(profile.LengthAt(10 + ramp_s + 1), ramp + 0.25, 1e-14);
  EXPECT_NEAR(profile.EndS(), 10 + 2 * ramp_s + (0.5 - 2 * ramp) / 0.25, 1e-12);
  EXPECT_EQ(profile.LengthAt(profile.EndS() + 1), 0.5);
  EXPECT_EQ(profile.SpeedAt(profile.EndS() + 1), 0);
  for (const double length : {0.001, 0.1, 0.49, 0.4999})
    EXPECT_NEAR(profile.LengthAt(profile.TimeOf(length)), length, 1e-12);
}

TEST(SpeedProfile, IsATriangleWhereTheWayIsShort) {
  const SpeedProfile profile(0, 0.01, 1, 1);
  EXPECT_NEAR(profile.EndS(), 2 * std::sqrt(0.01), 1e-12);
  EXPECT_NEAR(profile.SpeedAt(profile.EndS() / 2), 0.1, 1e-9);
}

TEST(SpeedProfile, KeepsItsPastWhenItIsStoppedOrSlowed) {
  SpeedProfile profile(0, 1, 0.1, 1);
  const double before = profile.LengthAt(2);
  profile.Cruise(3, 0.05, 1);
  EXPECT_EQ(profile.LengthAt(2), before);
  EXPECT_NEAR(profile.SpeedAt(4), 0.05, 1e-12);
  profile.Cruise(5, 0, 1);
  EXPECT_TRUE(std::isinf(profile.EndS()));
  EXPECT_EQ(profile.SpeedAt(6), 0);
  profile.Cruise(7, 0.1, 1);
  EXPECT_NEAR(profile.SpeedAt(8), 0.1, 1e-12);
  const double at_stop = profile.LengthAt(9);
  profile.Stop(9, 2);
  EXPECT_NEAR(profile.EndS(), 9.05, 1e-12);
  EXPECT_NEAR(profile.EndLength(), at_stop + 0.1 * 0.1 / 4, 1e-12);
  EXPECT_EQ(profile.LengthAt(2), before);
  for (double t = 0, last = 0; t < 10; t += 0.01) {
    EXPECT_GE(profile.LengthAt(t), last - 1e-15);
    last = profile.LengthAt(t);
  }
}

class Arms : public testing::TestWithParam<const char*> {};

TEST_P(Arms, ReachTheSamePoseInEveryBranchOfTheInverse) {
  const ArmGeometry arm = GeometryOf(GetParam());
  Joints joints;
  joints << 0.3, -1.2, -1.5, -1.4, 1.3, 0.4;
  const Eigen::Isometry3d pose = BaseFromFlange(arm, joints);
  const auto found = AllInverse(arm, pose, joints);
  EXPECT_GE(found.size(), 4u);  // elbow and wrist; the other shoulder does not reach every pose
  for (const Joints& each : found) EXPECT_TRUE(BaseFromFlange(arm, each).isApprox(pose, 1e-8));
  EXPECT_LT((found.front() - joints).norm(), 1e-7);
  Eigen::Isometry3d far = pose;
  far.translation() << 0.9, 0, 0.2;
  EXPECT_TRUE(AllInverse(arm, far, joints).empty());
}

TEST_P(Arms, HaveTheJacobianOfTheirForwardKinematics) {
  const ArmGeometry arm = GeometryOf(GetParam());
  Joints joints;
  joints << 0.3, -1.2, -1.5, -1.4, 1.3, 0.4;
  const auto jacobian = Jacobian(arm, joints);
  for (int i = 0; i < 6; ++i) {
    Joints more = joints, less = joints;
    more[i] += 1e-6;
    less[i] -= 1e-6;
    const Eigen::Isometry3d up = BaseFromFlange(arm, more), down = BaseFromFlange(arm, less);
    const Eigen::Vector3d linear = (up.translation() - down.translation()) / 2e-6;
    const Eigen::Vector3d angular = RotationVector(up.linear() * down.linear().transpose()) / 2e-6;
    EXPECT_LT((linear - jacobian.block<3, 1>(0, i)).norm(), 1e-8);
    EXPECT_LT((angular - jacobian.block<3, 1>(3, i)).norm(), 1e-8);
  }
}

INSTANTIATE_TEST_SUITE_P(Models, Arms, testing::Values("ur3", "ur3e"));

TEST(Arm, HasTheReachOfItsTable) {
  // Stretched out along -x: the links add up.
  const Eigen::Isometry3d flange = BaseFromFlange(GeometryOf("ur3"), Joints::Zero());
  EXPECT_NEAR(flange.translation().x(), -.24365 - .21325, 1e-12);
  EXPECT_NEAR(flange.translation().y(), -.11235 - .0819, 1e-12);
  EXPECT_NEAR(flange.translation().z(), .1519 - .08535, 1e-12);
}

TEST(LinePath, KeepsTheTipOnTheLineWhileItTurns) {
  const ArmGeometry arm = GeometryOf("ur3e");
  Eigen::Isometry3d tool = Eigen::Isometry3d::Identity();
  tool.translation().z() = 0.12;
  Eigen::Isometry3d end = BaseFromFlange(arm, Home()) * tool;
  end.translation() += Eigen::Vector3d(0.05, 0.03, -0.04);
  end.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 1, 0).normalized()));
  const LinePath path(arm, Home(), tool, end);
  EXPECT_FALSE(path.FirstObstacle(0.1, 1));
  for (double part = 0; part <= 1; part += 0.013) {
    const double length = part * path.Length();
    const Eigen::Isometry3d tip = BaseFromFlange(arm, path.JointsAt(length)) * tool;
    EXPECT_LT((tip.translation() -
               (path.from().translation() + part * (end.translation() - path.from().translation())))
                  .norm(),
              1e-8);
    EXPECT_TRUE(tip.linear().isApprox(path.TipAt(length).linear(), 1e-8));
  }
}

TEST(LinePath, TurnsHalfWayRoundInEitherDirectionToTheSameEnd) {
  const ArmGeometry arm = GeometryOf("ur3e");
  const Eigen::Isometry3d tool = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d end = BaseFromFlange(arm, Home());
  const Eigen::Vector3d x = end.linear().col(0);
  end.rotate(Eigen::AngleAxisd(3.1, Eigen::Vector3d::UnitZ()));
  const LinePath shorter(arm, Home(), tool, end), longer(arm, Home(), tool, end, LineTurn::kLonger);
  EXPECT_NEAR(shorter.TurnRad(), 3.1, 1e-9);
  EXPECT_NEAR(longer.TurnRad(), 2 * M_PI - 3.1, 1e-9);
  const auto half = [&](const LinePath& path) -> Eigen::Vector3d {
    return path.TipAt(path.Length() / 2).linear().col(0);
  };
  EXPECT_LT(half(shorter).dot(half(longer)), -0.999) << "half-way they point in opposite directions";
  EXPECT_NEAR(half(shorter).dot(x), std::cos(1.55), 1e-9);
  for (const LinePath* path : {&shorter, &longer})
    EXPECT_TRUE(BaseFromFlange(arm, path->JointsAt(path->Length())).linear().isApprox(end.linear(), 1e-6));
}

// Machine: programs that move.

struct Rig {
  Rig() : machine(Options(), &faults, nullptr) {}
  static ControllerOptions Options() {
    ControllerOptions options;
    options.powered = true;
    options.position_noise_m = options.joint_noise_rad = 0;
    return options;
  }
  void Run(const std::string& script, double seconds) {
    machine.StartProgram(script);
    machine.Advance(machine.now_s() + seconds, nullptr);
  }
  Eigen::Vector3d At(double time_s) { return machine.FlangeAt(time_s).translation(); }
  Faults faults;
  Machine machine;
};

TEST(Machine, MovesAlongALineExactlyAsTheTrapezoidSays) {
  Rig rig;
  const Eigen::Vector3d begin = rig.At(0);
  rig.Run("movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=0.5, v=0.1)\n", 0.7);
  const double expected = 0.1 * 0.2 / 2 + 0.1 * 0.5;
  EXPECT_NEAR((rig.At(0.7) - begin).norm(), expected, 1e-8);
  EXPECT_TRUE(rig.machine.Moving());
  rig.machine.Advance(5, nullptr);
  EXPECT_FALSE(rig.machine.Moving());
  EXPECT_NEAR((rig.At(5) - begin).norm(), 0.1, 1e-8);
  EXPECT_FALSE(rig.machine.program_running());
}

TEST(Machine, EndsUpAtTheSamePlaceHoweverOftenItIsAdvanced) {
  const char* script =
      "def two():\n movel(pose_trans(get_target_tcp_pose(), p[0,0,0.05,0,0,0]))\n"
      " movej([0.1,-1.5,-1.5,-1.5,1.5,0])\n sleep(0.1)\n stopl(1)\nend\n";
  Rig once, often;
  once.Run(script, 10);
  often.machine.StartProgram(script);
  for (double t = 0; t < 10; t += 0.003) often.machine.Advance(t, nullptr);
  EXPECT_EQ(once.machine.JointsAt(10), often.machine.JointsAt(10));
  EXPECT_NEAR(once.machine.JointsAt(10)[0], 0.1, 1e-12);
}

TEST(Machine, DrivesHalfAsFastAtHalfTheSpeedScaling) {
  Rig rig;
  rig.faults.Set("speed_scaling", 0.5);
  rig.machine.Advance(0, nullptr);
  const Eigen::Vector3d begin = rig.At(0);
  rig.Run("movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=0.5, v=0.1)\n", 1.4);
  EXPECT_NEAR((rig.At(1.4) - begin).norm(), 0.1 * 0.2 / 2 + 0.1 * 0.5, 1e-8);
  rig.faults.Set("speed_scaling", 0);
  rig.machine.Advance(1.5, nullptr);
  rig.machine.Advance(100, nullptr);
  EXPECT_TRUE(rig.machine.Moving());
  EXPECT_EQ(rig.At(90), rig.At(100));
  rig.faults.Set("speed_scaling", 1);
  rig.machine.Advance(101, nullptr);
  rig.machine.Advance(110, nullptr);
  EXPECT_NEAR((rig.At(110) - begin).norm(), 0.1, 1e-8);
}

TEST(Machine, StopsProtectivelyWhereItCannotGoOn) {
  Rig reach, speed, joint;
  reach.Run("movel(pose_trans(get_target_tcp_pose(), p[0,0,-0.6,0,0,0]))\n", 20);
  EXPECT_EQ(reach.machine.safety_mode(), kProtectiveStop);
  speed.Run("movej([3,-1.5,-1.5,-1.5,1.5,0], a=20, v=4)\n", 20);
  EXPECT_EQ(speed.machine.safety_mode(), kProtectiveStop);
  joint.Run("movej([6.5,-1.5,-1.5,-1.5,1.5,0])\n", 20);
  EXPECT_EQ(joint.machine.safety_mode(), kProtectiveStop);
  for (Rig* rig : {&reach, &speed, &joint}) {
    EXPECT_FALSE(rig->machine.Moving());
    EXPECT_FALSE(rig->machine.program_running());
    EXPECT_EQ(rig->machine.Count("protective_stops"), 1u);
  }
}

TEST(Machine, StopsAtOnceWithoutPowerAndMovesAgainOnlyWithIt) {
  Rig rig;
  const std::string script = "movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=0.5, v=0.1)\n";
  rig.Run(script, 0.5);
  rig.machine.PowerOff();
  const Eigen::Vector3d stopped = rig.At(0.5);
  rig.Run(script, 5);
  EXPECT_EQ(rig.At(rig.machine.now_s()), stopped);
  rig.machine.ReleaseBrakes();
  rig.machine.Advance(rig.machine.now_s() + 1, nullptr);
  EXPECT_EQ(rig.machine.robot_mode(), kPowerOn);
  rig.machine.Advance(rig.machine.now_s() + 10, nullptr);
  EXPECT_EQ(rig.machine.robot_mode(), kRunning);
  rig.Run(script, 5);
  EXPECT_NEAR((rig.At(rig.machine.now_s()) - stopped).norm(), 0.1, 1e-8);
}

TEST(Machine, ObeysTheEmergencyStopUntilItIsReleased) {
  Rig rig;
  rig.faults.Set("emergency_stop", 1);
  rig.machine.Advance(1, nullptr);
  EXPECT_EQ(rig.machine.safety_mode(), kRobotEmergencyStop);
  EXPECT_EQ(rig.machine.robot_mode(), kPowerOff);
  rig.machine.PowerOn();
  rig.machine.Advance(10, nullptr);
  EXPECT_EQ(rig.machine.robot_mode(), kPowerOff);
  rig.faults.Set("emergency_stop", 0);
  rig.machine.Advance(11, nullptr);
  EXPECT_EQ(rig.machine.safety_mode(), kNormal);
}

TEST(Machine, StandsStillWhileItIsFrozenAndGoesOnThen) {
  Rig rig;
  const Eigen::Vector3d begin = rig.At(0);
  rig.Run("movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=0.5, v=0.1)\n", 0.5);
  rig.machine.Freeze(0.5);
  EXPECT_EQ(rig.At(0.5), rig.At(3));
  rig.machine.Thaw(3);
  rig.machine.Advance(10, nullptr);
  EXPECT_NEAR((rig.At(10) - begin).norm(), 0.1, 1e-8);
}

TEST(Machine, FollowsSpeedlAndStopsWithStopl) {
  Rig rig;
  const Eigen::Vector3d begin = rig.At(0);
  rig.Run("def go():\n speedl([0,0,-0.05,0,0,0], 0.5, 1)\n stopl(1)\nend\n", 10);
  // Up to speed in 0.1 s, level until 1 s, down in 0.05 s.
  const double expected = 0.05 * 0.1 / 2 + 0.05 * 0.9 + 0.05 * 0.05 / 2;
  EXPECT_NEAR(begin.z() - rig.At(10).z(), expected, 1e-8);
  EXPECT_FALSE(rig.machine.Moving());
}

TEST(Machine, EndsTheRunningProgramWhenANewOneComes) {
  Rig rig;
  rig.Run("movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=0.5, v=0.1)\n", 0.5);
  rig.Run("def second():\n write_output_integer_register(3, 4)\nend\n", 5);
  EXPECT_FALSE(rig.machine.Moving());
  EXPECT_EQ(rig.machine.registers().output_int[3], 4);
  std::vector<std::string> keys;
  for (const Announcement& each : rig.machine.TakeAnnouncements())
    keys.push_back(each.title + " " + each.text);
  EXPECT_EQ(keys, (std::vector<std::string>{"PROGRAM_XXX_STARTED unnamed", "PROGRAM_XXX_STOPPED unnamed",
                                            "PROGRAM_XXX_STARTED second", "PROGRAM_XXX_STOPPED second"}));
}

TEST(Faults, AreEachRigsOwnAndRefuseWhatMakesNoSense) {
  Faults one, other;
  EXPECT_EQ(one.Set("drop_bytes", 0.5), "");
  EXPECT_EQ(one.Get("drop_bytes"), 0.5);
  EXPECT_EQ(other.Get("drop_bytes"), 0);
  EXPECT_NE(one.Set("drop_bytes", 2), "");
  EXPECT_NE(one.Set("no_such_fault", 1), "");
  EXPECT_NE(one.Set("line_delay_ms", std::nan("")), "");
  EXPECT_EQ(one.Get("stuck_finger"), -1);
  EXPECT_EQ(one.Get("speed_scaling"), 1);
  one.Set("disconnect", 1);
  EXPECT_EQ(one.Take("disconnect"), 1);
  EXPECT_EQ(one.Take("disconnect"), 0);
  EXPECT_EQ(one.UntilHostS("freeze"), 0);
  one.Set("freeze", 1000);
  EXPECT_GT(one.UntilHostS("freeze"), 0);
  one.Set("freeze", 0);
  EXPECT_EQ(one.UntilHostS("freeze"), 0);
  for (const std::string& name : Faults::Names()) EXPECT_EQ(one.Set(name, 0), "") << name;
}

TEST(SimClock, WaitsForThePartThatIsBehind) {
  SimClock clock(1e9);  // what the host's clock leaves room for, it shows at once
  EXPECT_FALSE(clock.Stands()) << "without parts nothing is waited for";
  SimClock::Part first(&clock, nullptr);
  {
    SimClock::Part second(&clock, nullptr);
    const double ahead_s = SimClock::kAheadHostS * clock.speedup();
    first.Done(1e18);
    while (!clock.Stands()) continue;
    const double stood_s = clock.NowS();
    EXPECT_EQ(clock.NowS(), stood_s);
    second.Done(stood_s);
    while (clock.NowS() == stood_s || !clock.Stands()) continue;
    EXPECT_NEAR(clock.NowS(), stood_s + ahead_s, 1e-6 * ahead_s);
  }
  EXPECT_FALSE(clock.Stands()) << "who has left is not waited for";
}

TEST(SimClock, StandsAtTheMomentThatAPartHasNotPassed) {
  SimClock clock(1e9);
  SimClock::Part first(&clock, nullptr), second(&clock, nullptr);
  const double ahead_s = SimClock::kAheadHostS * clock.speedup(), moment_s = clock.NowS() + 3 * ahead_s;
  first.Done(moment_s - ahead_s);
  while (!clock.Stands()) continue;
  EXPECT_LT(clock.NowS(), moment_s) << "the second one is behind";
  second.Done(moment_s - ahead_s);
  while (clock.NowS() < moment_s * (1 - 1e-9)) continue;
  EXPECT_FALSE(first.OthersDone(moment_s));
  second.Done(moment_s);
  EXPECT_TRUE(first.OthersDone(moment_s));
  second.Done(1e18);
  EXPECT_NEAR(clock.NowS(), moment_s, 1e-9 * moment_s);
  first.Done(moment_s);
  while (clock.NowS() < moment_s + 0.5 * ahead_s) continue;
}

TEST(SimClock, DoesNotMakeUpForTheTimeThatItStood) {
  SimClock clock(1);
  SimClock::Part part(&clock, nullptr);
  while (!clock.Stands()) continue;
  const double stood_s = clock.NowS(), until_s = HostNowS() + 0.02;
  while (HostNowS() < until_s) continue;
  part.Done(stood_s);
  EXPECT_LE(clock.NowS(), stood_s + SimClock::kAheadHostS + 1e-9);
  EXPECT_LE(clock.HostS(), HostNowS() - 0.02);
}

TEST(SimClock, OfATestMovesAsItIsTold) {
  SimClock clock(SimClock::Manual(), 4);
  EXPECT_EQ(clock.NowS(), 0);
  const double host_s = clock.HostS();
  std::atomic<int> woken{0};
  std::atomic<bool> ending{false};
  std::atomic<double> done_s{0};
  SimClock::Part part(&clock, [&] { ++woken; });
  std::thread thread([&] {
    while (!ending) {
      const double now_s = clock.NowS();
      done_s = now_s;
      part.Done(now_s);
    }
  });
  clock.MoveBy(0.011, 0.004);
  EXPECT_NEAR(done_s, 0.011, 1e-12) << "it came back before the part was done";
  ending = true;
  thread.join();
  EXPECT_EQ(woken, 3);
  EXPECT_NEAR(clock.NowS(), 0.011, 1e-12);
  EXPECT_NEAR(clock.HostS(), host_s + 0.00275, 1e-6);
  EXPECT_THROW(SimClock(2).MoveBy(1), std::logic_error);
}

TEST(Faults, LastAsLongOnTheClockThatTheyFollow) {
  SimClock clock(SimClock::Manual(), 10);
  Faults faults;
  faults.Follow(&clock);
  faults.Set("freeze", 2);
  EXPECT_GT(faults.UntilHostS("freeze"), 0);
  clock.MoveBy(19.5);
  EXPECT_GT(faults.UntilHostS("freeze"), 0);
  clock.MoveBy(1);
  EXPECT_EQ(faults.UntilHostS("freeze"), 0);
}

}  // namespace
}  // namespace touchstone::rig
