// The links to a controller that breaks the protocol.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mutex>
#include <optional>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "server/gateway/arm/protocol/big_endian.h"
#include "server/gateway/arm/protocol/dashboard_client.h"
#include "server/gateway/arm/protocol/fake_server.h"
#include "server/gateway/arm/protocol/rtde_client.h"
#include "server/gateway/arm/ur_arm.h"

namespace touchstone::gateway::arm {
namespace {

using ::testing::HasSubstr;

constexpr double kPatienceS = 60;  // host time

// A controller that speaks RTDE up to the start, with what a test wants different.
struct Script {
  bool knows_tcp_offset = true;
  std::string input_types = "INT32,INT32";
};

// True once it was asked to start.
bool Negotiate(FakeServer::Connection& connection, const Script& script) {
  RtdeFramer framer;
  while (true) {
    const std::string bytes = connection.Receive();
    if (bytes.empty()) return false;
    framer.Append(bytes);
    for (auto message = framer.Next(); message.ok() && message->has_value(); message = framer.Next()) {
      const auto type = static_cast<RtdeType>((*message)->type);
      std::string reply = "\1";
      if (type == RtdeType::kControllerVersion)
        reply = BigEndianWriter().U32(5).U32(12).U32(4).U32(1).bytes();
      if (type == RtdeType::kInputs) reply = "\2" + script.input_types;
      if (type == RtdeType::kOutputs) {
        reply =
            "\1DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,INT32,INT32,UINT32,UINT32,UINT32,DOUBLE,"
            "DOUBLE,INT32,INT32";
        if (absl::StrContains((*message)->payload, "tcp_offset"))
          reply += script.knows_tcp_offset ? ",VECTOR6D,INT32" : ",NOT_FOUND,NOT_FOUND";
      }
      connection.Send(EncodeRtde(type, reply));
      if (type == RtdeType::kStart) return true;
    }
  }
}

std::string Data(double timestamp_s, bool with_tcp_offset = true) {
  BigEndianWriter writer;
  writer.U8(1).F64(timestamp_s);
  for (int i = 0; i < 30; ++i) writer.F64(0);
  writer.I32(7).I32(1).U32(1).U32(1).U32(1).F64(1).F64(1).I32(0).I32(0);
  for (int i = 0; with_tcp_offset && i < 6; ++i) writer.F64(0);
  if (with_tcp_offset) writer.I32(0);
  return EncodeRtde(RtdeType::kData, writer.bytes());
}

// A client and what it heard.
struct Listening {
  explicit Listening(int port)
      : client(
            {"127.0.0.1", port, 500, 10},
            [this](const RtdeSample& sample, double) {
              std::lock_guard<std::mutex> lock(mutex);
              newest = sample;
              changes.Notify();
            },
            [this] { changes.Notify(); }) {}
  bool Hears(double timestamp_s) {
    return Wait([&] {
      std::lock_guard<std::mutex> lock(mutex);
      return newest.has_value() && newest->timestamp_s == timestamp_s;
    });
  }
  template <typename Done>
  bool Wait(Done done) {
    for (const double until_s = timing::HostNowS() + kPatienceS; timing::HostNowS() < until_s;) {
      if (done()) return true;
      changes.WaitForChange(changes.count(), 0.01);
    }
    return false;
  }
  std::mutex mutex;
  std::optional<RtdeSample> newest;
  timing::ChangeNotifier changes;
  RtdeClient client;
};

TEST(RtdeClient, ConnectsAgainAfterWhatItCannotUnderstand) {
  const std::vector<std::string> nonsense = {std::string("\0\1U", 3), EncodeRtde(RtdeType::kData, "\1short"),
                                             EncodeRtde(RtdeType::kData, "\7" + Data(1).substr(4)), ""};
  FakeServer server([&](FakeServer::Connection& connection, int number) {
    if (!Negotiate(connection, Script())) return;
    connection.Send(Data(100 + number));
    if (number < 4) return connection.Send(nonsense[static_cast<size_t>(number)]);  // and closes
    while (!connection.Receive().empty()) {
    }
  });
  Listening listening(server.port());
  EXPECT_TRUE(listening.Hears(104));
  EXPECT_TRUE(listening.client.Link().ok()) << listening.client.Link();
  EXPECT_EQ(listening.client.ControllerVersion(), "5.12.4.1");
}

TEST(RtdeClient, TellsWhichRegisterAnotherClientHolds) {
  FakeServer server([](FakeServer::Connection& connection, int) {
    Negotiate(connection, {true, "INT32,IN_USE"});
  });
  Listening listening(server.port());
  EXPECT_TRUE(listening.Wait([&] { return absl::StrContains(listening.client.Link().message(), "IN_USE"); }));
  EXPECT_THAT(std::string(listening.client.Link().message()), HasSubstr("input_int_register_25"));
  EXPECT_EQ(listening.client.Link().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(RtdeClient, DoesWithoutTheToolsOffsetWhereTheControllerDoesNotTellIt) {
  FakeServer server([](FakeServer::Connection& connection, int) {
    if (!Negotiate(connection, {false, "INT32,INT32"})) return;
    connection.Send(Data(7, false));
    while (!connection.Receive().empty()) {
    }
  });
  Listening listening(server.port());
  ASSERT_TRUE(listening.Hears(7));
  EXPECT_FALSE(listening.newest->has_tcp_offset);
}

TEST(RtdeClient, WritesBothRegistersInOnePackage) {
  std::mutex mutex;
  std::string heard;
  FakeServer server([&](FakeServer::Connection& connection, int) {
    if (!Negotiate(connection, Script())) return;
    connection.Send(Data(1));
    const std::string bytes = connection.Receive();
    std::lock_guard<std::mutex> lock(mutex);
    heard = bytes;
  });
  Listening listening(server.port());
  ASSERT_TRUE(listening.Hears(1));
  ASSERT_TRUE(listening.client.WriteInputs(3, 69).ok());
  EXPECT_TRUE(listening.Wait([&] {
    std::lock_guard<std::mutex> lock(mutex);
    return heard == EncodeInputs(2, 3, 69);
  }));
}

TEST(DashboardClient, NeverTakesALateReplyForAnother) {
  FakeServer server([](FakeServer::Connection& connection, int number) {
    connection.Send("Connected: Universal Robots Dashboard Server\n");
    for (std::string line = connection.Receive(); !line.empty(); line = connection.Receive())
      if (number > 0) connection.Send("reply to " + line);  // the first connection never replies
  });
  DashboardClient dashboard("127.0.0.1", server.port());
  EXPECT_EQ(dashboard.Ask("robotmode", 0.2).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(dashboard.Ask("safetymode", kPatienceS).value(), "reply to safetymode");
  EXPECT_EQ(dashboard.Demand("play", "Starting", kPatienceS).code(), absl::StatusCode::kFailedPrecondition);
}

TEST(DashboardClient, SomethingElseOnThePortIsNoDashboard) {
  FakeServer server([](FakeServer::Connection& connection, int) { connection.Send("SSH-2.0-OpenSSH\r\n"); });
  DashboardClient dashboard("127.0.0.1", server.port());
  EXPECT_THAT(std::string(dashboard.Ask("robotmode", kPatienceS).status().message()), HasSubstr("SSH-2.0"));
}

TEST(DashboardClient, ConnectsAnewAfterARefusalInLocalControl) {
  FakeServer server([](FakeServer::Connection& connection, int number) {
    connection.Send("Connected: Universal Robots Dashboard Server\n");
    for (std::string line = connection.Receive(); !line.empty(); line = connection.Receive())
      connection.Send(
          number > 0 ? "Powering on\n"
                     : "Command is not allowed due to safety reasons, please switch robot to Remote Control "
                       "mode and reconnect to port 29999\n");
  });
  DashboardClient dashboard("127.0.0.1", server.port());
  const absl::Status refused = dashboard.Demand("power on", "Powering on", kPatienceS);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("Remote Control"));
  EXPECT_TRUE(dashboard.Demand("power on", "Powering on", kPatienceS).ok());
}

// Ports on which nobody listens.
UrArmOptions Nowhere() {
  UrArmOptions options;
  options.address = "127.0.0.1";
  FakeServer gone([](FakeServer::Connection&, int) {});
  options.dashboard_port = options.primary_port = options.secondary_port = options.rtde_port = gone.port();
  options.connect_wait_s = 0.05;
  return options;
}

TEST(UrArm, WithoutAControllerEverythingSaysSo) {
  timing::ChangeNotifier changes;
  const auto arm = ConnectUrArm(Nowhere(), &changes);
  ASSERT_TRUE(arm.ok()) << "it goes on trying";
  EXPECT_EQ((*arm)->State().status().code(), absl::StatusCode::kUnavailable);
  EXPECT_FALSE((*arm)->Ready().ok());
  const absl::Status stopped = (*arm)->Stop();
  EXPECT_EQ(stopped.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(stopped.message()), HasSubstr("emergency stop"));
}

TEST(UrArm, StopGoesOverTheDashboardWhereNoProgramCanBeSent) {
  std::atomic<bool> stopped{false};
  FakeServer dashboard([&](FakeServer::Connection& connection, int) {
    connection.Send("Connected: Universal Robots Dashboard Server\n");
    if (connection.Receive() == "stop\n") stopped = true;
    connection.Send("Stopped\n");
  });
  UrArmOptions options = Nowhere();
  options.dashboard_port = dashboard.port();
  timing::ChangeNotifier changes;
  const auto arm = ConnectUrArm(options, &changes);
  ASSERT_TRUE(arm.ok());
  EXPECT_TRUE((*arm)->Stop().ok());
  EXPECT_TRUE(stopped);
}

// A controller on which nothing runs answers "Failed to execute: stop"; so may one that would not stop.
TEST(UrArm, StopThatTheDashboardFailsIsDoneOnlyWhereNothingRuns) {
  for (const bool running : {false, true}) {
    FakeServer dashboard([&](FakeServer::Connection& connection, int) {
      connection.Send("Connected: Universal Robots Dashboard Server\n");
      for (std::string line = connection.Receive(); !line.empty(); line = connection.Receive())
        connection.Send(line == "stop\n" ? "Failed to execute: stop\n"
                        : line == "running\n"
                            ? (running ? "Program running: true\n" : "Program running: false\n")
                            : "could not understand\n");
    });
    UrArmOptions options = Nowhere();
    options.dashboard_port = dashboard.port();
    timing::ChangeNotifier changes;
    const auto arm = ConnectUrArm(options, &changes);
    ASSERT_TRUE(arm.ok());
    const absl::Status stopped = (*arm)->Stop();
    EXPECT_EQ(stopped.ok(), !running) << stopped;
    if (running) {
      EXPECT_THAT(std::string(stopped.message()), HasSubstr("Program running: true"));
    }
  }
}

// A stop needs nothing but the program port: no state, no dashboard.
TEST(UrArm, StopIsSentOverTheProgramPortAlone) {
  std::mutex mutex;
  std::string heard;
  FakeServer secondary([&](FakeServer::Connection& connection, int) {
    for (std::string bytes = connection.Receive(); !bytes.empty(); bytes = connection.Receive()) {
      std::lock_guard<std::mutex> lock(mutex);
      heard += bytes;
    }
  });
  UrArmOptions options = Nowhere();
  options.secondary_port = secondary.port();
  timing::ChangeNotifier changes;
  const auto arm = ConnectUrArm(options, &changes);
  ASSERT_TRUE(arm.ok());
  EXPECT_TRUE((*arm)->Stop().ok());
  for (const double until_s = timing::HostNowS() + kPatienceS; timing::HostNowS() < until_s;) {
    std::lock_guard<std::mutex> lock(mutex);
    if (absl::StrContains(heard, "stopl(10)")) break;
  }
  std::lock_guard<std::mutex> lock(mutex);
  EXPECT_THAT(heard, HasSubstr("stopl(10)"));
}

TEST(UrArm, OptionsThatMakeNoSenseAreRefused) {
  timing::ChangeNotifier changes;
  UrArmOptions options = Nowhere();
  options.model = "ur10";
  EXPECT_EQ(ConnectUrArm(options, &changes).status().code(), absl::StatusCode::kInvalidArgument);
  options = Nowhere();
  options.rtde_port = 70000;
  EXPECT_EQ(ConnectUrArm(options, &changes).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace touchstone::gateway::arm
