#include "tests/rig/world/device.h"

#include <gtest/gtest.h>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>

#include "firmware/core/frame.h"
#include "firmware/core/messages.h"
#include "server/base/test_folder.h"

namespace touchstone::rig {
namespace {

using Seconds = std::chrono::duration<double>;
constexpr double kPatienceS = 20;  // of the host: a loaded machine

double HostS() {
  return std::chrono::duration_cast<Seconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Lets time pass until then.
bool WaitFor(SimClock* clock, const std::function<bool()>& done) {
  for (const double until = HostS() + kPatienceS; HostS() < until;) {
    if (done()) return true;
    clock->MoveBy(0.002);
  }
  return false;
}

// A host at the other end of the line, with the firmware's own messages. It lets time pass while it waits.
class Host {
 public:
  Host(const std::string& port, SimClock* clock)
      : fd_(open(port.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK)), clock_(clock) {
    termios raw{};
    tcgetattr(fd_, &raw);
    cfmakeraw(&raw);
    tcsetattr(fd_, TCSANOW, &raw);
  }
  ~Host() { close(fd_); }

  template <typename Message>
  void Send(const Message& message) {
    uint8_t payload[firmware::kMaxPayload], frame[firmware::kMaxFrame];
    const size_t size = firmware::EncodeFrame(payload, firmware::Encode(message, payload), frame);
    EXPECT_EQ(write(fd_, frame, size), static_cast<ssize_t>(size));
  }
  // The next message of this kind that pleases; others are passed over. Patience: of the rig's time.
  template <typename Message>
  std::optional<Message> Await(double patience_s, const std::function<bool(const Message&)>& pleases) {
    for (const double until_s = clock_->NowS() + patience_s; clock_->NowS() < until_s;) {
      pollfd wait{fd_, POLLIN, 0};
      if (poll(&wait, 1, 0) == 0) clock_->MoveBy(0.001);
      uint8_t byte;
      while (read(fd_, &byte, 1) == 1) {
        ++bytes_;
        Message message;
        if (parser_.Push(byte) && firmware::Decode(parser_.payload(), parser_.size(), &message) &&
            pleases(message))
          return message;
      }
    }
    return std::nullopt;
  }
  // Asks until it is answered.
  template <typename Answer, typename Question>
  std::optional<Answer> Ask(
      const Question& question,
      const std::function<bool(const Answer&)>& pleases = [](const Answer&) { return true; }) {
    for (const double until = HostS() + kPatienceS; HostS() < until;) {
      Send(question);
      if (auto answer = Await<Answer>(0.3, pleases)) return answer;
    }
    return std::nullopt;
  }
  firmware::HelloReply Begin(int fingers, firmware::Sensor sensor) {
    const auto hello = Ask<firmware::HelloReply>(firmware::Hello{firmware::kProtocolVersion, 7});
    EXPECT_TRUE(hello.has_value());
    firmware::Configure configure;
    configure.fingers = static_cast<uint8_t>(fingers);
    for (auto& finger : configure.finger) finger.sensor = sensor, finger.debounce_us = 5000;
    EXPECT_TRUE(Ask<firmware::Configured>(configure).has_value());
    return hello.value_or(firmware::HelloReply{});
  }
  bool Arm(uint32_t touch) {
    return Ask<firmware::Armed>(firmware::Arm{touch},
                                [&](const firmware::Armed& armed) { return armed.touch == touch; })
        .has_value();
  }
  // The contact of each finger, ticks, from the record.
  std::optional<firmware::Recalled> Contacts(uint32_t touch, int fingers) {
    for (const double until = HostS() + kPatienceS; HostS() < until;) {
      const auto recalled = Ask<firmware::Recalled>(firmware::Recall{touch});
      if (recalled && recalled->contact_mask == (1 << fingers) - 1) return recalled;
    }
    return std::nullopt;
  }

  int fd_;
  SimClock* const clock_;
  uint64_t bytes_ = 0;
  firmware::FrameParser parser_;
};

class DeviceTest : public testing::Test {
 protected:
  void Start(const std::string& sensor = "optical", double byte_s = 0, bool unplug_resets = false) {
    DeviceOptions options;
    options.link = Port();
    options.sensor = sensor, options.byte_s = byte_s, options.unplug_resets = unplug_resets;
    options.drift_ppm = 40;
    faults_.Follow(&clock_);
    device_ = std::make_unique<Device>(options, &clock_, &faults_);
  }
  std::string Port() const { return folder_.Path("effector"); }
  // Contacts of the three fingers at these moments from now on.
  std::vector<double> Press(const std::vector<double>& after_s, double known_after_s = 0) {
    std::vector<double> at_s;
    const double now_s = clock_.NowS();
    for (size_t i = 0; i < after_s.size(); ++i) {
      at_s.push_back(now_s + after_s[i]);
      device_->OnEdge({static_cast<int>(i), true, at_s.back(), at_s.back() + known_after_s});
    }
    return at_s;
  }
  // How far the reported ticks are off the truth, seconds.
  double ErrorS(uint64_t ticks, double at_s) const {
    const double turn = std::ldexp(1, 32);
    return std::remainder(static_cast<double>(ticks) - device_->TicksAt(at_s), turn) / device_->tick_hz();
  }

  SimClock clock_{SimClock::Manual()};
  Faults faults_;
  TestFolder folder_;
  std::unique_ptr<Device> device_;
};

TEST_F(DeviceTest, StampsContactsToTheTickHoweverLateTheyAreHandedOver) {
  Start();
  Host host(Port(), &clock_);
  const auto hello = host.Begin(3, firmware::Sensor::kOptical);
  EXPECT_EQ(hello.boot_id, device_->boot_id());
  EXPECT_EQ(hello.tick_hz, 16'000'000u);
  ASSERT_TRUE(host.Arm(1));
  // What was captured before the touch began is not of it.
  clock_.MoveBy(0.05);
  const auto at_s = Press({0.02, 0.005, -0.01}, 0.05);
  const auto contacts = host.Contacts(1, 3);
  ASSERT_TRUE(contacts);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(ErrorS(contacts->ticks[i], at_s[i]), 0, 1.5 / 16e6) << i;
}

TEST_F(DeviceTest, AContactComesBeforeWhatIsSentAfterIt) {
  Start();
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kOptical);
  for (uint32_t touch = 1; touch <= 400; ++touch) {
    ASSERT_TRUE(host.Arm(touch));
    // The device is awake, at another place of its turn every time, when the finger presses and "disarm" follows.
    host.Send(firmware::Clock{touch});
    for (const double until_s = HostS() + touch % 40 * 1e-6; HostS() < until_s;) continue;
    const double now_s = clock_.NowS();
    device_->OnEdge({0, true, now_s, now_s});
    host.Send(firmware::Disarm{});
    const auto recalled = host.Ask<firmware::Recalled>(firmware::Recall{touch});
    ASSERT_TRUE(recalled);
    ASSERT_EQ(recalled->contact_mask, 1) << "touch " << touch;
    const double released_s = clock_.NowS();
    device_->OnEdge({0, false, released_s, released_s});
  }
}

TEST_F(DeviceTest, AnswersClockQueriesWithItsOwnDriftingCounter) {
  Start();
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kOptical);
  const double before_s = clock_.NowS();
  const auto reply = host.Ask<firmware::ClockReply>(firmware::Clock{3});
  const double after_s = clock_.NowS();
  ASSERT_TRUE(reply);
  EXPECT_GT(ErrorS(reply->receive_ticks, before_s), -1 / 16e6) << "whole ticks";
  EXPECT_LE(ErrorS(reply->send_ticks, after_s), 0);
  EXPECT_NEAR(device_->TicksAt(11) - device_->TicksAt(10), 16e6 * (1 + 40e-6), 1e-3);
  faults_.Set("clock_drift_ppm", 100);
  EXPECT_TRUE(WaitFor(&clock_, [&] {
    const double now_s = clock_.NowS();
    return std::abs(device_->TicksAt(now_s + 1) - device_->TicksAt(now_s) - 16e6 * (1 + 140e-6)) < 1e-3;
  }));
}

TEST_F(DeviceTest, BouncesOnlyWhenTold) {
  for (const double bounce : {0.0, 1.0}) {
    std::vector<double> levels;
    Pins pins("microswitch", 1, 3, {[&](int, bool level, double) { levels.push_back(level); }, nullptr});
    pins.Add({0, true, 1.0, 1.0}, bounce > 0);
    pins.Run(2.0, -1);
    EXPECT_EQ(levels.back(), 1);
    EXPECT_EQ(levels.size() > 1, bounce > 0) << levels.size();
    EXPECT_EQ(levels.size() % 2, 1u);
  }
}

TEST_F(DeviceTest, TellsTheFirstEdgeOfABouncingSwitchOnce) {
  Start("microswitch");
  faults_.Set("bounce", 1);
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kMicroswitch);
  ASSERT_TRUE(host.Arm(1));
  const auto at_s = Press({0.03, 0.01, 0.02});
  const auto contacts = host.Contacts(1, 3);
  ASSERT_TRUE(contacts);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(ErrorS(contacts->ticks[i], at_s[i]), 0, 1.5 / 16e6) << i;
}

TEST_F(DeviceTest, CrossesTheThresholdOfAResistorAtTheContact) {
  Start("resistor");
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kResistor);
  ASSERT_TRUE(host.Arm(1));
  const auto at_s = Press({0.03, 0.01, 0.0203});
  const auto contacts = host.Contacts(1, 3);
  ASSERT_TRUE(contacts);
  // The converter's steps: 40 counts a millisecond.
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(ErrorS(contacts->ticks[i], at_s[i]), 0, 30e-6) << i;
}

TEST_F(DeviceTest, ReadsAStuckFingerAsPressed) {
  Start();
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kOptical);
  const auto pressed = [&](int mask) {
    return host
        .Ask<firmware::Status>(firmware::StatusRequest{},
                               [&](const firmware::Status& status) { return status.pressed_mask == mask; })
        .has_value();
  };
  EXPECT_TRUE(pressed(0));
  faults_.Set("stuck_finger", 2);
  EXPECT_TRUE(pressed(4));
  host.Send(firmware::Arm{1});
  const auto refused =
      host.Await<firmware::Refused>(kPatienceS, [](const firmware::Refused&) { return true; });
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason, firmware::RefusedReason::kPressed);
  EXPECT_EQ(refused->detail, 4u);
  faults_.Set("stuck_finger", -1);
  EXPECT_TRUE(pressed(0));
}

TEST_F(DeviceTest, KeepsItsRecordWhenOnlyTheLineWasUnplugged) {
  Start();
  const uint32_t boot_id = device_->boot_id();
  std::vector<double> at_s;
  {
    Host host(Port(), &clock_);
    host.Begin(3, firmware::Sensor::kOptical);
    ASSERT_TRUE(host.Arm(9));
    faults_.Set("unplug", 3600);
    ASSERT_TRUE(WaitFor(&clock_, [&] { return !std::filesystem::exists(Port()); }));
    at_s = Press({0.0, 0.001, 0.002});
    // Its end of the line has hung up.
    uint8_t byte;
    ssize_t got = 1;
    EXPECT_TRUE(
        WaitFor(&clock_, [&] { return (got = read(host.fd_, &byte, 1)) == 0 || (got < 0 && errno == EIO); }));
  }
  faults_.Set("unplug", 0);  // in again
  ASSERT_TRUE(WaitFor(&clock_, [&] { return std::filesystem::exists(Port()); }));
  Host host(Port(), &clock_);
  const auto contacts = host.Contacts(9, 3);
  ASSERT_TRUE(contacts);
  EXPECT_NEAR(ErrorS(contacts->ticks[1], at_s[1]), 0, 1.5 / 16e6);
  EXPECT_EQ(device_->boot_id(), boot_id);
}

TEST_F(DeviceTest, BootsAnewWhenItsPowerWasUnpluggedOrItIsReset) {
  Start("optical", 0, true);
  const uint32_t first = device_->boot_id();
  faults_.Set("unplug", 0.05);
  ASSERT_TRUE(WaitFor(&clock_, [&] { return device_->boot_id() != first; }));
  const uint32_t second = device_->boot_id();
  {
    Host host(Port(), &clock_);
    EXPECT_EQ(host.Begin(3, firmware::Sensor::kOptical).boot_id, second);
  }
  device_->Reset();
  EXPECT_TRUE(WaitFor(&clock_, [&] { return device_->boot_id() != second; }));
}

TEST_F(DeviceTest, LosesAndDamagesBytesOnTheLineYetTellsEveryContactRight) {
  Start();
  faults_.Set("drop_bytes", 0.005), faults_.Set("corrupt_bytes", 0.005),
      faults_.Set("duplicate_bytes", 0.005);
  faults_.Set("line_delay_ms", 5);
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kOptical);
  ASSERT_TRUE(host.Arm(1));
  const auto at_s = Press({0.002, 0.004, 0.006});
  const auto contacts = host.Contacts(1, 3);
  ASSERT_TRUE(contacts);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(ErrorS(contacts->ticks[i], at_s[i]), 0, 1.5 / 16e6) << i;
  EXPECT_TRUE(WaitFor(&clock_, [&] {
    host.Await<firmware::Status>(0.2, [](const firmware::Status&) { return false; });
    return host.parser_.bad_frames() > 0;
  }));
}

TEST_F(DeviceTest, TakesTheLinesTimeForItsBytes) {
  Start("optical", 10.0 / 115200);
  Host host(Port(), &clock_);
  host.Begin(3, firmware::Sensor::kOptical);
  const double before_s = clock_.NowS();
  const auto reply = host.Ask<firmware::ClockReply>(firmware::Clock{3});
  ASSERT_TRUE(reply);
  // Clock is at least 9 bytes long, its reply 25.
  EXPECT_GE(ErrorS(reply->receive_ticks, before_s), 9 * 10 / 115200.0);
  EXPECT_LE(ErrorS(reply->send_ticks, clock_.NowS()), -25 * 10 / 115200.0);
}

}  // namespace
}  // namespace touchstone::rig
