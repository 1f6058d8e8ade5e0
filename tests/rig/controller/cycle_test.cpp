// What the controller's clock, its speed and its watchdogs do, as on a UR.
#include <cmath>

#include <gtest/gtest.h>

#include "tests/rig/controller/machine/machine.h"
#include "tests/rig/controller/protocol/dashboard.h"
#include "tests/rig/controller/protocol/realtime_packet.h"
#include "tests/rig/controller/protocol/test_client.h"

namespace touchstone::rig {
namespace {

ControllerOptions Exact(const std::string& model = "ur3e") {
  ControllerOptions options;
  options.model = model;
  options.powered = true;
  options.position_noise_m = options.joint_noise_rad = 0;
  return options;
}

// 0.1 m down: up to 0.1 m/s within 0.2 s, level, 1.2 s in all.
constexpr char kDown[] = "movel(pose_trans(get_target_tcp_pose(), p[0,0,0.1,0,0,0]), a=0.5, v=0.1)\n";

double OffGrid(double time_s, double cycle_s) {
  return std::abs(time_s / cycle_s - std::round(time_s / cycle_s));
}

class Cycles : public testing::TestWithParam<const char*> {};

TEST_P(Cycles, EveryStateIsStampedOnTheControllersGridAndSaysWhatWasTrueThen) {
  Machine machine(Exact(GetParam()), nullptr, nullptr);
  const double cycle_s = std::string(GetParam()) == "ur3" ? 0.008 : 0.002, lag_s = Exact().following_lag_s;
  const double first_stamp_s = machine.State().timestamp_s;
  machine.StartProgram(kDown);
  machine.Advance(0, nullptr);
  const double begin_z = machine.State().target_tcp_pose[2];
  for (double time_s = 0.2513; time_s < 1; time_s += 0.0107) {
    machine.Advance(time_s, nullptr);
    const RobotState state = machine.State();
    const double at_s = state.timestamp_s - first_stamp_s;
    EXPECT_LT(OffGrid(state.timestamp_s, cycle_s), 1e-6) << state.timestamp_s;
    EXPECT_LE(at_s, time_s + 1e-9);
    EXPECT_GT(at_s, time_s - cycle_s - 1e-9);
    EXPECT_NEAR(begin_z - state.target_tcp_pose[2], 0.1 * (at_s - 0.1), 1e-8);
    EXPECT_NEAR(begin_z - state.actual_tcp_pose[2], 0.1 * (at_s - lag_s - 0.1), 1e-8);
    EXPECT_NEAR(state.actual_tcp_speed[2], -0.1, 1e-6);
  }
}

TEST_P(Cycles, TheStreamHasEveryCycleOnce) {
  SimClock clock{SimClock::Manual()};
  const auto controller = Controller::Start(Exact(GetParam()), &clock, nullptr, nullptr);
  const double cycle_s = std::string(GetParam()) == "ur3" ? 0.008 : 0.002;
  TouchClient client(controller->ports().rtde, "", &clock);
  client.Next();
  for (int i = 0; i < 200; ++i) {
    const double before_s = client.timestamp_s;
    client.Next();
    EXPECT_LT(OffGrid(client.timestamp_s, cycle_s), 1e-6);
    const double cycles = (client.timestamp_s - before_s) / cycle_s;
    EXPECT_NEAR(cycles, 1, 1e-6);
    // A host that is late by up to 50 cycles makes up for them.
    if (i == 100) clock.MoveBy(49 * cycle_s, 49 * cycle_s);
  }
}

TEST_P(Cycles, ProgramsBeginAndGoOnAtCycles) {
  Machine machine(Exact(GetParam()), nullptr, nullptr);
  machine.Advance(0.0123, nullptr);
  machine.StartProgram(
      "def two():\n movej([0.01,-1.5708,-1.5708,-1.5708,1.5708,0])\n"
      " write_output_integer_register(3, 4)\nend\n");
  EXPECT_TRUE(machine.program_running());
  std::vector<double> changes_s;
  machine.Advance(3, [&] { changes_s.push_back(machine.now_s()); });
  ASSERT_FALSE(changes_s.empty());
  for (const double at_s : changes_s)
    EXPECT_LT(OffGrid(at_s, std::string(GetParam()) == "ur3" ? 0.008 : 0.002), 1e-6) << at_s;
  EXPECT_EQ(machine.registers().output_int[3], 4);
}

INSTANTIATE_TEST_SUITE_P(Models, Cycles, testing::Values("ur3", "ur3e"));

TEST(SpeedScaling, IsTheLimitersAndTheSliderIsAnotherAndTheArmObeysBoth) {
  Faults faults;
  Machine machine(Exact(), &faults, nullptr);
  faults.Set("speed_scaling", 0.8);
  faults.Set("speed_slider", 0.5);
  machine.Advance(0, nullptr);
  EXPECT_EQ(machine.State().speed_scaling, 0.8);
  EXPECT_EQ(machine.State().target_speed_fraction, 0.5);
  machine.StartProgram(kDown);
  machine.Advance(1.5, nullptr);
  EXPECT_NEAR(machine.State().target_tcp_speed[2], -0.04, 1e-6);
  EXPECT_EQ(machine.State().speed_scaling, 0.8);
}

TEST(SpeedScaling, OfTheSliderCountsTheLastHandWhetherAPersonsOrAClients) {
  Faults faults;
  Machine machine(Exact(), &faults, nullptr);
  faults.Set("speed_slider", 0.5);
  machine.Advance(0.1, nullptr);
  machine.SetSpeedSlider(0.25);
  machine.Advance(0.2, nullptr);
  EXPECT_EQ(machine.State().target_speed_fraction, 0.25);
  faults.Set("speed_slider", 1);
  machine.Advance(0.3, nullptr);
  EXPECT_EQ(machine.State().target_speed_fraction, 1);
}

std::string Watched(const std::string& action) {
  return "def watched():\n rtde_set_watchdog(\"input_int_register_24\", 10, \"" + action + "\")\n " + kDown +
         "end\n";
}

std::string AskDashboard(Machine* machine, const std::string& line) {
  bool quit = false;
  return AnswerDashboard(line, "ur3e", false, machine, &quit);
}

TEST(Watchdog, StopEndsTheProgramWithoutAProtectiveStop) {
  Machine machine(Exact(), nullptr, nullptr);
  machine.StartProgram(Watched("stop"));
  machine.Advance(0.3, nullptr);
  machine.CheckWatchdogs(nullptr);
  EXPECT_FALSE(machine.program_running());
  EXPECT_EQ(machine.safety_mode(), kNormal);
  EXPECT_EQ(machine.Count("watchdog_stops"), 1u);
  EXPECT_EQ(machine.Count("protective_stops"), 0u);
  machine.Advance(0.5, nullptr);
  EXPECT_FALSE(machine.Moving());
  EXPECT_EQ(machine.State().runtime_state, kStopped);
  // It ended with its program: the next one has none.
  machine.StartProgram(kDown);
  machine.Advance(1, nullptr);
  machine.CheckWatchdogs(nullptr);
  EXPECT_TRUE(machine.Moving());
}

TEST(Watchdog, PausePausesAndPlayGoesOn) {
  Machine machine(Exact(), nullptr, nullptr);
  const double begin_z = machine.State().target_tcp_pose[2];
  machine.StartProgram(Watched("pause"));
  machine.Advance(0.3, nullptr);
  machine.CheckWatchdogs(nullptr);
  EXPECT_EQ(machine.State().runtime_state, kPausing);
  machine.Advance(5, nullptr);
  EXPECT_EQ(machine.State().runtime_state, kPaused);
  EXPECT_FALSE(machine.Moving());
  EXPECT_EQ(AskDashboard(&machine, "running"), "Program running: false");
  EXPECT_EQ(AskDashboard(&machine, "play"), "Starting program");
  machine.InputWritten("input_int_register_24");
  for (double time_s = 5; time_s < 9; time_s += 0.05) {
    machine.Advance(time_s, nullptr);
    machine.InputWritten("input_int_register_24");
    machine.CheckWatchdogs(nullptr);
  }
  EXPECT_EQ(machine.State().runtime_state, kStopped);
  EXPECT_NEAR(begin_z - machine.State().target_tcp_pose[2], 0.1, 1e-8);
}

TEST(Watchdog, IgnoreOnlyWatches) {
  Machine machine(Exact(), nullptr, nullptr);
  machine.StartProgram(Watched("ignore"));
  machine.Advance(0.5, nullptr);
  machine.CheckWatchdogs(nullptr);
  EXPECT_TRUE(machine.program_running());
}

TEST(Dashboard, PausesAndStopsWhatRunsAndSaysSoWhereNothingDoes) {
  Machine machine(Exact(), nullptr, nullptr);
  EXPECT_EQ(AskDashboard(&machine, "stop"), "Failed to execute: stop");
  EXPECT_EQ(AskDashboard(&machine, "pause"), "Failed to execute: pause");
  machine.StartProgram(kDown);
  machine.Advance(0.3, nullptr);
  EXPECT_EQ(AskDashboard(&machine, "pause"), "Pausing program");
  machine.Advance(1, nullptr);
  EXPECT_EQ(AskDashboard(&machine, "stop"), "Stopped");
  EXPECT_EQ(AskDashboard(&machine, "play"), "Failed to execute: play");
  machine.Advance(2, nullptr);
  EXPECT_EQ(machine.State().runtime_state, kStopped);
}

TEST(Payload, TakesTheToolForItsCentreOfGravityWhereNoneIsGiven) {
  Machine machine(Exact(), nullptr, nullptr);
  const auto run = [&](const std::string& script) {
    machine.StartProgram(script);
    machine.Advance(machine.now_s() + 0.01, nullptr);
    return machine.State().payload_cog_m;
  };
  const Eigen::Vector3d tool(0, 0, 0.12), given(0, 0.01, 0.03);
  EXPECT_EQ(run("def a():\n set_payload(1)\n set_tcp(p[0,0,0.12,0,0,0])\nend\n"), tool);
  EXPECT_EQ(run("def b():\n set_payload(1, [0,0.01,0.03])\n set_tcp(p[0,0,0.2,0,0,0])\nend\n"), given);
  EXPECT_EQ(run("set_payload_mass(2)\n"), given);
  EXPECT_EQ(machine.State().payload_kg, 2);
}

TEST(LocalControl, MovesNothingFromOutsideAndTellsEverything) {
  Faults faults;
  Machine e_series(Exact("ur3e"), &faults, nullptr), cb3(Exact("ur3"), &faults, nullptr);
  faults.Set("local_control", 1);
  for (Machine* machine : {&e_series, &cb3}) {
    machine->StartProgram(kDown);
    machine->Advance(0.3, nullptr);
  }
  EXPECT_FALSE(e_series.program_running());
  EXPECT_TRUE(cb3.program_running()) << "CB3 knows no local control";
  bool quit = false;
  EXPECT_EQ(AskDashboard(&e_series, "is in remote control"), "false");
  EXPECT_EQ(AskDashboard(&e_series, "robotmode"), "Robotmode: RUNNING");
  EXPECT_EQ(AskDashboard(&e_series, "power off").substr(0, 22), "Command is not allowed");
  faults.Set("local_control", 0);
  EXPECT_EQ(AnswerDashboard("power off", "ur3e", true, &e_series, &quit).substr(0, 22),
            "Command is not allowed")
      << "a connection from before must reconnect";
  EXPECT_EQ(AskDashboard(&e_series, "power off"), "Powering off");
}

// The layout is UR's "RealTime 5.10": offsets by its table.
TEST(Realtime, PacketHasTheTablesSizeAndPlaces) {
  Machine machine(Exact(), nullptr, nullptr);
  machine.SetPayload(0.7, Eigen::Vector3d(0.01, 0.02, 0.03));
  machine.Advance(0.01, nullptr);
  const RobotState state = machine.State();
  const std::string packet = RealtimePacket(state);
  ASSERT_EQ(packet.size(), 1220u);
  EXPECT_EQ(WireReader(packet).Get<int32_t>(), 1220);
  const auto at = [&](size_t offset) {
    return WireReader(std::string_view(packet).substr(offset)).Get<double>();
  };
  EXPECT_EQ(at(4), state.timestamp_s);
  EXPECT_EQ(at(12 + 8), state.target_q[1]);
  EXPECT_EQ(at(252 + 8), state.actual_q[1]);
  EXPECT_EQ(at(444), state.actual_tcp_pose[0]);
  EXPECT_EQ(at(588 + 16), state.target_tcp_pose[2]);
  EXPECT_EQ(at(756), kRunning);
  EXPECT_EQ(at(764), 253);
  EXPECT_EQ(at(812), kNormal);
  EXPECT_EQ(at(940), 1);
  EXPECT_EQ(at(1052), kStopped);
  EXPECT_EQ(at(1060), state.elbow_m[0]);
  EXPECT_EQ(at(1108), kNormal);
  EXPECT_EQ(at(1140), 0.7);
  EXPECT_EQ(at(1148 + 16), 0.03);
}

TEST(Realtime, PortRunsProgramsAndItsTwinOnlyTells) {
  SimClock clock(SimClock::Manual(), 20);
  const auto controller = Controller::Start(Exact(), &clock, nullptr, nullptr);
  TestClient realtime(controller->ports().realtime), twin(controller->ports().realtime_read_only);
  const std::string program = "def go():\n write_output_integer_register(25, 3)\nend\n";
  twin.Send(program);
  while (twin.buffer.size() < 1220) ASSERT_TRUE(twin.More(&clock));
  EXPECT_EQ(WireReader(twin.buffer).Get<int32_t>(), 1220);
  EXPECT_EQ(controller->Count("programs"), 0u);
  realtime.Send(program);
  TouchClient state(controller->ports().rtde, "", &clock);
  state.Until([&] { return state.phase == 3; });
  EXPECT_EQ(controller->Count("programs"), 1u);
}

}  // namespace
}  // namespace touchstone::rig
