#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/rig/controller/protocol/dashboard.h"
#include "tests/rig/controller/protocol/primary_packets.h"
#include "tests/rig/controller/protocol/rtde_session.h"

namespace touchstone::rig {
namespace {

ControllerOptions PoweredWithoutNoise() {
  ControllerOptions options;
  options.powered = true;
  options.position_noise_m = options.joint_noise_rad = 0;
  return options;
}

std::string Bytes(std::initializer_list<int> bytes) {
  std::string text;
  for (const int byte : bytes) text.push_back(static_cast<char>(byte));
  return text;
}

struct Session {
  explicit Session(const std::string& model = "ur3e")
      : machine(PoweredWithoutNoise(), nullptr, nullptr), rtde(&machine, model, &taken) {}
  std::string Ask(std::string bytes) {
    const std::string answer = rtde.Receive(&bytes);
    EXPECT_EQ(bytes, "");
    return answer;
  }
  Machine machine;
  RtdeSession::Taken taken;
  RtdeSession rtde;
};

TEST(Rtde, AnswersByteForByte) {
  Session session;
  EXPECT_EQ(session.Ask(Bytes({0, 5, 86, 0, 2})), Bytes({0, 4, 86, 1}));
  EXPECT_EQ(session.Ask(Bytes({0, 5, 86, 0, 9})), Bytes({0, 4, 86, 0}));
  EXPECT_EQ(session.Ask(Bytes({0, 3, 118})),
            Bytes({0, 19, 118, 0, 0, 0, 5, 0, 0, 0, 11, 0, 0, 0, 0, 0, 1, 166, 217}));
  EXPECT_EQ(Session("ur3").Ask(Bytes({0, 3, 118})),
            Bytes({0, 19, 118, 0, 0, 0, 3, 0, 0, 0, 15, 0, 0, 0, 8, 0, 1, 159, 99}));
  // 125 Hz is 0x405F400000000000.
  EXPECT_EQ(session.Ask(Bytes({0, 36, 79, 0x40, 0x5F, 0x40, 0, 0, 0, 0, 0}) + "robot_mode,safety_status,"),
            Bytes({0, 15, 79, 1}) + "INT32,INT32");
  EXPECT_EQ(session.rtde.rate_hz(), 125);
  EXPECT_FALSE(session.rtde.started());
  EXPECT_EQ(session.Ask(Bytes({0, 3, 83})), Bytes({0, 4, 83, 1}));
  EXPECT_TRUE(session.rtde.started());
  EXPECT_EQ(session.rtde.Data(session.machine.State()), Bytes({0, 12, 85, 1, 0, 0, 0, 7, 0, 0, 0, 1}));
  EXPECT_EQ(session.Ask(Bytes({0, 3, 80})), Bytes({0, 4, 80, 1}));
  EXPECT_FALSE(session.rtde.started());
  EXPECT_EQ(session.Ask(Bytes({0, 24, 73}) + "input_int_register_24"), Bytes({0, 9, 73, 1}) + "INT32");
  EXPECT_EQ(session.Ask(Bytes({0, 8, 85, 1, 0xFF, 0xFF, 0xFF, 0xFE})), "");
  EXPECT_EQ(session.machine.registers().input_int[24], -2);
}

std::string Types(Session* session, const std::string& names) {
  WireWriter to;
  to.Put(500.0).Text(names);
  return session->Ask(RtdeMessage('O', to.bytes)).substr(4);
}

TEST(Rtde, TellsTheTypesOfItsFields) {
  Session session;
  EXPECT_EQ(Types(&session, "timestamp,actual_q,robot_mode,runtime_state,actual_digital_input_bits"),
            "DOUBLE,VECTOR6D,INT32,UINT32,UINT64");
  EXPECT_EQ(
      Types(&session, "payload_cog,joint_mode,output_bit_register_64,output_bit_registers0_to_31,tcp_offset"),
      "VECTOR3D,VECTOR6INT32,BOOL,UINT32,VECTOR6D");
  EXPECT_EQ(
      Types(&session,
            "output_int_register_47,output_double_register_0,input_int_register_24,target_speed_fraction"),
      "INT32,DOUBLE,INT32,DOUBLE");
  EXPECT_EQ(Types(&session, "timestamp,nonsense"), "DOUBLE,NOT_FOUND");
  EXPECT_EQ(session.Ask(RtdeMessage('S', "")), Bytes({0, 4, 83, 0}));
}

// UR's table of outputs has these from 5.2 and 5.9 on, CB3 never; the last from 5.15 on.
TEST(Rtde, HasTheFieldsOfItsSeriesAndVersion) {
  Session e_series, cb3("ur3");
  const std::string names =
      "tool_output_mode,tool_digital_output0_mode,tool_digital_output1_mode,ft_raw_wrench,payload_inertia,"
      "collision_detection_ratio";
  EXPECT_EQ(Types(&e_series, names), "UINT8,UINT8,UINT8,VECTOR6D,VECTOR6D,NOT_FOUND");
  EXPECT_EQ(Types(&cb3, names), "NOT_FOUND,NOT_FOUND,NOT_FOUND,NOT_FOUND,VECTOR6D,NOT_FOUND");
}

TEST(Rtde, WritesAsManyBytesAsTheTypeSays) {
  const std::map<std::string, size_t> sizes = {
      {"BOOL", 1},   {"UINT8", 1},     {"INT32", 4},     {"UINT32", 4},        {"UINT64", 8},
      {"DOUBLE", 8}, {"VECTOR3D", 24}, {"VECTOR6D", 48}, {"VECTOR6INT32", 24}, {"VECTOR6UINT32", 24}};
  Machine machine(PoweredWithoutNoise(), nullptr, nullptr);
  const RobotState state = machine.State();
  for (const auto& [name, output] : RtdeOutputs()) {
    WireWriter to;
    output.write(state, &to);
    ASSERT_TRUE(sizes.count(output.type)) << name;
    EXPECT_EQ(to.bytes.size(), sizes.at(output.type)) << name;
  }
  for (const auto& [name, input] : RtdeInputs()) EXPECT_EQ(input.bytes, sizes.at(input.type)) << name;
}

TEST(Rtde, LendsAnInputToOneClientAtATime) {
  Session first;
  auto second = std::make_unique<RtdeSession>(&first.machine, "ur3e", &first.taken);
  std::string ask = RtdeMessage('I', "input_int_register_24,input_int_register_25");
  EXPECT_EQ(second->Receive(&ask).substr(3), Bytes({1}) + "INT32,INT32");
  EXPECT_EQ(first.Ask(RtdeMessage('I', "input_int_register_24,input_double_register_24,x")).substr(3),
            Bytes({0}) + "IN_USE,DOUBLE,NOT_FOUND");
  second.reset();
  EXPECT_EQ(first.Ask(RtdeMessage('I', "input_int_register_24")).substr(3), Bytes({1}) + "INT32");
  // The same client may use a variable in several recipes.
  EXPECT_EQ(first.Ask(RtdeMessage('I', "input_int_register_24,speed_slider_mask")).substr(3),
            Bytes({2}) + "INT32,UINT32");
}

TEST(Rtde, RefusesInputsOfTheWrongSizeAndUnknownMessagesWithoutHarm) {
  Session session;
  session.Ask(RtdeMessage('I', "input_int_register_24"));
  EXPECT_EQ(session.Ask(RtdeMessage('U', Bytes({1, 0, 0})))[2], 'M');
  EXPECT_EQ(session.Ask(RtdeMessage('U', ""))[2], 'M');
  EXPECT_EQ(session.Ask(RtdeMessage('Z', "abc"))[2], 'M');
  EXPECT_EQ(session.Ask(RtdeMessage('O', "abc"))[2], 'M');
  EXPECT_FALSE(session.rtde.broken());
  std::string broken = Bytes({0, 2, 86, 0, 0});
  session.rtde.Receive(&broken);
  EXPECT_TRUE(session.rtde.broken());
}

TEST(Rtde, SetsTheSpeedSlider) {
  Session session;
  session.Ask(RtdeMessage('I', "speed_slider_mask,speed_slider_fraction"));
  WireWriter to;
  to.Put(uint8_t{1}).Put(uint32_t{1}).Put(0.25);
  session.Ask(RtdeMessage('U', to.bytes));
  EXPECT_EQ(session.machine.State().target_speed_fraction, 0.25);
}

TEST(Primary, PacksTheSubPackagesThatClientsLookFor) {
  Machine machine(PoweredWithoutNoise(), nullptr, nullptr);
  const std::string packet = StatePacket(machine.State(), machine.geometry(), "ur3e");
  EXPECT_EQ(packet.size(), 5u + 47 + 251 + 101 + 225 + 445);
  WireReader from(packet);
  EXPECT_EQ(from.Get<uint32_t>(), packet.size());
  EXPECT_EQ(from.Get<uint8_t>(), 16);
  std::map<int, std::string> parts;
  while (!from.left.empty()) {
    const uint32_t size = WireReader(from.left).Get<uint32_t>();
    ASSERT_GE(size, 5u);
    parts[from.left[4]] = std::string(from.left.substr(5, size - 5));
    from.left.remove_prefix(size);
  }
  ASSERT_EQ(parts.size(), 5u);
  EXPECT_EQ(parts[0].size(), 42u);
  EXPECT_EQ(parts[0].substr(8, 9), Bytes({1, 1, 1, 0, 0, 0, 0, 7, 0}));
  WireReader joints(parts[1]);
  EXPECT_EQ(joints.Get<double>(), 0);
  WireReader kinematics(parts[5]);
  kinematics.left.remove_prefix(6 * 4 + 6 * 8);
  kinematics.Get<double>();
  EXPECT_EQ(kinematics.Get<double>(), -.24355);
  EXPECT_EQ(parts[6].substr(440 - 8), Bytes({0, 0, 0, 3, 0, 0, 0, 0}));
}

TEST(Primary, WritesItsMessagesByteForByte) {
  EXPECT_EQ(AnnouncementPacket({Announcement::kKey, "PROGRAM_XXX_STARTED", "go"}, 1e-6),
            Bytes({0, 0, 0, 45, 20, 0, 0, 0, 0, 0, 0, 0, 1, 253, 7, 0, 0, 0, 0, 0, 0, 0, 0, 19}) +
                "PROGRAM_XXX_STARTEDgo");
  EXPECT_EQ(AnnouncementPacket({Announcement::kException, "", "x", 3, 4}, 0),
            Bytes({0, 0, 0, 24, 20, 0, 0, 0, 0, 0, 0, 0, 0, 253, 10, 0, 0, 0, 3, 0, 0, 0, 4}) + "x");
  const std::string version = VersionPacket("ur3");
  EXPECT_EQ(version.substr(0, 25),
            Bytes({0, 0, 0, static_cast<int>(version.size()), 20, 0, 0, 0, 0, 0, 0, 0, 0, 254, 3, 9}) +
                "URControl");
  EXPECT_EQ(version.substr(25, 10), Bytes({3, 15, 0, 0, 0, 8, 0, 1, 159, 99}));
}

std::string Ask(Machine* machine, const std::string& line, const std::string& model = "ur3e") {
  bool quit = false;
  return AnswerDashboard(line, model, false, machine, &quit);
}

TEST(Dashboard, SpeaksTheTextsOfTheController) {
  ControllerOptions options;
  Machine machine(options, nullptr, nullptr);
  EXPECT_EQ(Ask(&machine, "robotmode"), "Robotmode: POWER_OFF");
  EXPECT_EQ(Ask(&machine, "safetymode\r"), "Safetymode: NORMAL");
  EXPECT_EQ(Ask(&machine, "power on"), "Powering on");
  machine.Advance(1.1, nullptr);
  EXPECT_EQ(Ask(&machine, "robotmode"), "Robotmode: POWER_ON");
  machine.Advance(3, nullptr);
  EXPECT_EQ(Ask(&machine, "robotmode"), "Robotmode: IDLE");
  EXPECT_EQ(Ask(&machine, "brake release"), "Brake releasing");
  EXPECT_EQ(Ask(&machine, "robotmode"), "Robotmode: IDLE");
  machine.Advance(5, nullptr);
  EXPECT_EQ(Ask(&machine, "robotmode"), "Robotmode: RUNNING");
  EXPECT_EQ(Ask(&machine, "play"), "Failed to execute: play");
  EXPECT_EQ(Ask(&machine, "stop"), "Failed to execute: stop");
  EXPECT_EQ(Ask(&machine, "running"), "Program running: false");
  EXPECT_EQ(Ask(&machine, "programState"), "STOPPED");
  EXPECT_EQ(Ask(&machine, "PolyscopeVersion", "ur3"), "URSoftware 3.15.8.106339 (Jun 20 2022)");
  EXPECT_EQ(Ask(&machine, "is in remote control"), "true");
  EXPECT_EQ(Ask(&machine, "is in remote control", "ur3"), "could not understand: 'is in remote control'");
  EXPECT_EQ(Ask(&machine, "make coffee"), "could not understand: 'make coffee'");
  bool quit = false;
  EXPECT_EQ(AnswerDashboard("quit", "ur3e", false, &machine, &quit), "Disconnected");
  EXPECT_TRUE(quit);
}

TEST(Dashboard, TellsAProtectiveStopLateAndUnlocksItAfterFiveSeconds) {
  Faults faults;
  Machine machine(PoweredWithoutNoise(), &faults, nullptr);
  machine.Advance(1, nullptr);
  faults.Set("protective_stop", 1);
  machine.Advance(2, nullptr);
  EXPECT_EQ(machine.State().safety_mode, 3);
  EXPECT_EQ(machine.State().safety_status_bits, (1u << 2) | (1u << 10));
  EXPECT_EQ(Ask(&machine, "safetymode"), "Safetymode: NORMAL");
  machine.Advance(2.7, nullptr);
  EXPECT_EQ(Ask(&machine, "safetymode"), "Safetymode: PROTECTIVE_STOP");
  machine.Advance(6.9, nullptr);
  EXPECT_THAT(Ask(&machine, "unlock protective stop"),
              testing::StartsWith("Cannot unlock protective stop until 5s"));
  machine.Advance(7.1, nullptr);
  EXPECT_EQ(Ask(&machine, "unlock protective stop"), "Protective stop releasing");
  EXPECT_EQ(machine.safety_mode(), 3);
  machine.Advance(8, nullptr);
  EXPECT_EQ(machine.safety_mode(), 1);
}

TEST(Dashboard, StopsTheProgramAndTheArm) {
  Machine machine(PoweredWithoutNoise(), nullptr, nullptr);
  machine.StartProgram("movej([1,-1.5,-1.5,-1.5,1.5,0])\n");
  machine.Advance(0.5, nullptr);
  EXPECT_EQ(Ask(&machine, "running"), "Program running: true");
  EXPECT_EQ(Ask(&machine, "stop"), "Stopped");
  EXPECT_EQ(machine.State().runtime_state, kStopping);
  machine.Advance(1, nullptr);
  EXPECT_EQ(machine.State().runtime_state, kStopped);
  EXPECT_LT(machine.JointsAt(1)[0], 0.9);
}

}  // namespace
}  // namespace touchstone::rig
