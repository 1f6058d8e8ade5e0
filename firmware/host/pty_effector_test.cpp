#include "firmware/host/pty_effector.h"

#include <chrono>

#include <fcntl.h>
#include <unistd.h>

#include <gtest/gtest.h>

namespace touchstone::firmware {
namespace {

// A host on the other side of the pseudo-terminal.
class Host {
 public:
  explicit Host(PtyEffector* effector)
      : effector_(effector), fd_(open(effector->path().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK)) {}
  ~Host() { close(fd_); }
  template <typename Message>
  void Send(const Message& message) {
    uint8_t payload[kMaxPayload];
    uint8_t frame[kMaxFrame];
    const size_t size = EncodeFrame(payload, Encode(message, payload), frame);
    ASSERT_EQ(write(fd_, frame, size), static_cast<ssize_t>(size));
  }
  // The next message of this type; false if none comes.
  template <typename Message>
  bool Wait(Message* message, int max_s = 20) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(max_s);
    while (std::chrono::steady_clock::now() < until) {
      effector_->Run();
      uint8_t byte;
      while (read(fd_, &byte, 1) == 1) {
        if (parser_.Push(byte) && Decode(parser_.payload(), parser_.size(), message)) return true;
      }
    }
    return false;
  }

 private:
  PtyEffector* effector_;
  int fd_;
  FrameParser parser_;
};

TEST(PtyEffector, ReportsAPressOverTheTerminal) {
  std::string error;
  const auto effector = PtyEffector::Open(&error);
  ASSERT_NE(effector, nullptr) << error;
  Host host(effector.get());
  host.Send(Hello{kProtocolVersion, 77});
  HelloReply hello;
  ASSERT_TRUE(host.Wait(&hello));
  EXPECT_EQ(hello.nonce, 77u);
  EXPECT_STREQ(hello.firmware, "host 0.1.0");

  Configure configure;
  configure.fingers = 3;
  host.Send(configure);
  Configured configured;
  ASSERT_TRUE(host.Wait(&configured));
  host.Send(Arm{4});
  Armed armed;
  ASSERT_TRUE(host.Wait(&armed));

  effector->Press(2, true);
  Event event;
  ASSERT_TRUE(host.Wait(&event));
  EXPECT_EQ(event.touch, 4u);
  EXPECT_EQ(event.finger, 2);
  EXPECT_GE(event.ticks, armed.ticks);
}

TEST(PtyEffector, GoesOnAfterAHostThatWentAwayAndReadNothing) {
  std::string error;
  const auto effector = PtyEffector::Open(&error);
  ASSERT_NE(effector, nullptr) << error;
  {
    Host host(effector.get());
    // More replies than any buffer holds.
    for (int i = 0; i < 2000; ++i) {
      effector->Run();
      uint8_t payload[kMaxPayload];
      uint8_t frame[kMaxFrame];
      const size_t size = EncodeFrame(payload, Encode(StatusRequest{}, payload), frame);
      const int fd = open(effector->path().c_str(), O_WRONLY | O_NOCTTY | O_NONBLOCK);
      ASSERT_GE(fd, 0);
      EXPECT_EQ(write(fd, frame, size), static_cast<ssize_t>(size));
      close(fd);
    }
  }
  Host host(effector.get());
  host.Send(Hello{kProtocolVersion, 5});
  HelloReply hello;
  // The first replies are lost while the line is still full: a host asks again.
  for (int i = 0; i < 20 && !host.Wait(&hello, 1); ++i) host.Send(Hello{kProtocolVersion, 5});
  EXPECT_EQ(hello.nonce, 5u);
}

}  // namespace
}  // namespace touchstone::firmware
