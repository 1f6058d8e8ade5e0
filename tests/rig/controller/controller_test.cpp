#include "tests/rig/controller.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/rig/controller/network/unread.h"
#include "tests/rig/controller/protocol/test_client.h"

namespace touchstone::rig {
namespace {

// A surface that a single finger meets: how far below z the tip is pushed.
class Surface : public TipListener {
 public:
  explicit Surface(double height_m) : height_m_(height_m) {}
  void OnMotionBegan(const StraightMotion& motion) override {
    motion_ = motion;
    ++begun;
  }
  double OnProgress(uint64_t number, double now_s, double distance_m,
                    const std::function<double(double)>& distance_at) override {
    EXPECT_EQ(number, motion_.number);
    EXPECT_NEAR(distance_at(now_s), distance_m, 1e-12);
    EXPECT_GE(distance_m, 0);
    const double length = (motion_.to.translation() - motion_.from.translation()).norm();
    const double slope =
        length > 0 ? (motion_.to.translation().z() - motion_.from.translation().z()) / length : 0;
    return height_m_ - (motion_.from.translation().z() + slope * distance_m);
  }
  void OnMotionEnded(uint64_t number, double) override {
    EXPECT_EQ(number, motion_.number);
    ++ended;
  }
  std::atomic<int> begun{0}, ended{0};

 private:
  double height_m_;
  StraightMotion motion_;
};

constexpr char kTouch[] = R"(def touch_7():
  rtde_set_watchdog("input_int_register_24", 10.0, "stop")
  set_tcp(p[0,0,0.12,0,0,0])
  write_output_integer_register(24, 7)
  write_output_integer_register(25, 1)
  start = get_target_tcp_pose()
  goal = pose_trans(start, p[0, 0, 0.02, 0, 0, 0])
  movel(goal, a=1.2, v=0.25)
  write_output_integer_register(25, 2)
  while read_input_integer_register(25) != 29: sync() end
  write_output_integer_register(25, 3)
  global arrived = False
  thread approach():
    movel(pose_trans(goal, p[0, 0, 0.05, 0, 0, 0]), a=1.2, v=0.02)
    arrived = True
  end
  going = run approach()
  while not arrived and read_input_integer_register(25) != 30:
    sync()
  end
  kill going
  stopl(2.0)
  write_output_integer_register(25, 4)
  movel(goal, a=1.2, v=0.25)
  write_output_integer_register(25, 5)
end
)";

ControllerOptions Powered() {
  ControllerOptions options;
  options.powered = true;
  return options;
}

class TouchAtSpeedup : public testing::TestWithParam<double> {};

TEST_P(TouchAtSpeedup, RunsThroughItsPhasesAndKeepsItsRegisters) {
  SimClock clock(SimClock::Manual(), GetParam());
  Faults faults;
  Surface surface(-10);
  const auto controller = Controller::Start(Powered(), &clock, &faults, &surface);
  {
    TouchClient touch(controller->ports().rtde, "", &clock);
    TestClient script(controller->ports().secondary);
    std::string text = kTouch;
    // The watchdog counts simulated time, and this client beats once a package.
    if (GetParam() > 1) text.replace(text.find("10.0"), 4, "0.0001");
    touch.Beat();
    script.Send(text);
    touch.Until([&] { return touch.phase == 2; });
    EXPECT_EQ(touch.program, 7);
    EXPECT_EQ(touch.runtime_state, 2u);
    EXPECT_FALSE(controller->Moving());
    const double start_z = touch.pose[2];
    touch.Command(29);
    touch.Until([&] { return touch.phase == 3; });
    touch.Until([&] { return touch.pose[2] < start_z - 0.002 || touch.phase > 3; });
    touch.Command(30);
    touch.Until([&] { return touch.phase == 5 && touch.runtime_state == 1; });
    EXPECT_NEAR(touch.pose[2], start_z, 1e-4);
    EXPECT_EQ(touch.safety_mode, 1);
  }
  TouchClient again(controller->ports().rtde, "", &clock);
  again.Next();
  EXPECT_EQ(again.program, 7);
  EXPECT_EQ(again.phase, 5);
  EXPECT_EQ(controller->Count("programs"), 1u);
  EXPECT_EQ(controller->Count("motions"), 3u);
  EXPECT_EQ(surface.begun, 3);
  EXPECT_EQ(surface.ended, 3);
}

INSTANTIATE_TEST_SUITE_P(Speeds, TouchAtSpeedup, testing::Values(1.0, 20.0, 1000.0));

TEST(Controller, StopsProtectivelyWhereAFingerIsPushedTooFar) {
  SimClock clock(SimClock::Manual(), 20);
  Faults faults;
  Surface surface(-10);
  auto options = Powered();
  const auto probe = Controller::Start(options, &clock, &faults, nullptr);
  const double z = probe->BaseFromFlange().translation().z();
  Surface near(z - 0.03);
  const auto controller = Controller::Start(options, &clock, &faults, &near);
  TouchClient touch(controller->ports().rtde, "", &clock);
  TestClient script(controller->ports().secondary);
  script.Send(
      "def push():\n write_output_integer_register(25, 1)\n"
      " movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=1.2, v=0.02)\n"
      " write_output_integer_register(25, 2)\nend\n");
  // The program is paused, not ended.
  touch.Until([&] { return touch.safety_mode == 3 && touch.runtime_state == 4; });
  EXPECT_EQ(touch.phase, 1);
  EXPECT_EQ(controller->Count("protective_stops"), 1u);
  EXPECT_LT(controller->BaseFromTip().translation().z(), z - 0.04);
  TestClient dashboard(controller->ports().dashboard);
  EXPECT_EQ(dashboard.Line(), "Connected: Universal Robots Dashboard Server");
  // Nothing moves until it is unlocked, which takes 5 s.
  script.Send("movel(pose_trans(get_target_tcp_pose(), p[0,0,-0.05,0,0,0]))\n");
  std::string answer;
  const double begin_s = clock.NowS();
  while ((answer = dashboard.Ask("unlock protective stop")) != "Protective stop releasing") {
    EXPECT_EQ(answer,
              "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective "
              "stop before "
              "unlocking");
    ASSERT_LT(clock.NowS(), begin_s + 6);
    clock.MoveBy(0.1);
  }
  touch.Until([&] { return touch.safety_mode == 1; });
  EXPECT_EQ(controller->Count("programs"), 1u);
}

TEST(Controller, EndsTheProgramWhoseWatchdogNobodyFeeds) {
  SimClock clock(SimClock::Manual(), 10);
  Faults faults;
  const auto controller = Controller::Start(Powered(), &clock, &faults, nullptr);
  TouchClient touch(controller->ports().rtde, "", &clock);
  TestClient script(controller->ports().secondary);
  script.Send(
      "def watched():\n rtde_set_watchdog(\"input_int_register_24\", 0.05, \"stop\")\n"
      " write_output_integer_register(25, 1)\n while True: sync() end\nend\n");
  touch.Until([&] { return touch.phase == 1; });
  // Fed for longer than its period: goes on.
  const double fed_until_s = touch.timestamp_s + 22;
  touch.Until([&] { return touch.timestamp_s > fed_until_s; });
  EXPECT_EQ(touch.safety_mode, 1);
  EXPECT_EQ(touch.runtime_state, 2u);
  touch.Until([&] { return touch.runtime_state == 1; }, false);
  EXPECT_EQ(controller->Count("watchdog_stops"), 1u);
  EXPECT_EQ(controller->Count("protective_stops"), 0u);
  EXPECT_EQ(touch.safety_mode, 1);
}

// Until the clock has stood for 50 ms of the host; false: it goes on and on.
bool WaitsForSomebody(const SimClock& clock) {
  double since_s = HostNowS();
  for (const double until_s = since_s + 0.7; HostNowS() < until_s;) {
    if (!clock.Stands()) since_s = HostNowS();
    if (HostNowS() > since_s + 0.05) return true;
  }
  return false;
}

TEST(Controller, LetsTimeWaitForAClientThatDoesNotReadUntilItHasHungForASecond) {
  SimClock clock(20);
  Faults faults;
  const auto controller = Controller::Start(Powered(), &clock, &faults, nullptr);
  TouchClient client(controller->ports().rtde);
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(WaitsForSomebody(clock)) << k;
    const double stood_s = clock.NowS();
    EXPECT_EQ(clock.NowS(), stood_s);
    while (clock.NowS() == stood_s) client.Next();
  }
  // A second later time passes without it, until it reads again.
  const double stood_s = clock.NowS(), began_s = HostNowS();
  while (clock.NowS() < stood_s + 100 * SimClock::kAheadHostS * clock.speedup())
    ASSERT_LT(HostNowS(), began_s + 30);
  EXPECT_GT(HostNowS(), began_s + 0.9 * ReaderPatience::kPatienceS);
  for (int k = 0; k < 20; ++k) client.Next();
  EXPECT_TRUE(WaitsForSomebody(clock));
}

TEST(ReaderPatience, EndsAfterASecondWithoutReadingAndBeginsAnewWithIt) {
  ReaderPatience patience;
  EXPECT_FALSE(patience.WaitsFor(0));
  EXPECT_TRUE(patience.WaitsFor(10));
  EXPECT_TRUE(patience.WaitsFor(20));
  const double began_s = HostNowS();
  while (patience.WaitsFor(20)) ASSERT_LT(HostNowS(), began_s + 30);
  EXPECT_FALSE(patience.WaitsFor(30)) << "more to read is nothing read";
  EXPECT_TRUE(patience.WaitsFor(29));
  EXPECT_FALSE(patience.WaitsFor(0));
  EXPECT_TRUE(patience.WaitsFor(1));
}

}  // namespace
}  // namespace touchstone::rig
