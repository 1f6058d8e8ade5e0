// A client for tests: connects, sends, and reads with a generous time limit.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>
#include <stdexcept>
#include <string>

#include "tests/rig/controller/network/net.h"
#include "tests/rig/controller/network/wire.h"
#include "tests/rig/controller/protocol/rtde_session.h"
#include "tests/rig/world.h"

namespace touchstone::rig {

class TestClient {
 public:
  explicit TestClient(int port) : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<uint16_t>(port));
    inet_pton(AF_INET, "127.0.0.1", &at.sin_addr);
    if (connect(fd_, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0)
      throw std::runtime_error("cannot connect");
  }
  ~TestClient() { close(fd_); }
  TestClient(const TestClient&) = delete;
  TestClient& operator=(const TestClient&) = delete;

  void Send(const std::string& bytes) {
    for (size_t sent = 0; sent < bytes.size();) {
      const ssize_t n = send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) return;  // the peer has closed
      sent += static_cast<size_t>(n);
    }
  }
  // Reads more into `buffer`; false once the peer has closed. Throws after 20 s of silence.
  bool More() {
    pollfd polled{fd_, POLLIN, 0};
    if (poll(&polled, 1, 20000) <= 0) throw std::runtime_error("nothing came within 20 s");
    char bytes[8192];
    const ssize_t n = recv(fd_, bytes, sizeof bytes, 0);
    if (n <= 0) return false;
    buffer.append(bytes, static_cast<size_t>(n));
    return true;
  }
  std::string Line() {
    while (buffer.find('\n') == std::string::npos)
      if (!More()) throw std::runtime_error("closed in the middle of a line");
    const std::string line = buffer.substr(0, buffer.find('\n'));
    buffer.erase(0, line.size() + 1);
    return line;
  }
  std::string Ask(const std::string& question) {
    Send(question + "\n");
    return Line();
  }
  // Likewise where time stands still unless it is moved: by one package of data whenever nothing is there to be read.
  bool More(SimClock* clock) {
    for (pollfd polled{fd_, POLLIN, 0}; clock != nullptr && poll(&polled, 1, 0) == 0;)
      clock->MoveBy(kPackageS * clock->speedup(), kPackageS * clock->speedup());
    return More();
  }
  // One RTDE message: its type and payload.
  std::pair<char, std::string> Rtde(SimClock* clock = nullptr) {
    for (;;) {
      if (buffer.size() >= 3) {
        const size_t size = WireReader(buffer).Get<uint16_t>();
        if (buffer.size() >= size) {
          const std::pair<char, std::string> message{buffer[2], buffer.substr(3, size - 3)};
          buffer.erase(0, size);
          return message;
        }
      }
      if (!More(clock)) throw std::runtime_error("closed in the middle of a message");
    }
  }
  std::string RtdeReply(char type, const std::string& payload) {
    Send(RtdeMessage(static_cast<uint8_t>(type), payload));
    for (;;)
      if (const auto [got, answer] = Rtde(); got == type) return answer;
  }
  // A packet of the primary interface: its type and body.
  std::pair<int, std::string> Packet() {
    for (;;) {
      if (buffer.size() >= 5) {
        const size_t size = WireReader(buffer).Get<uint32_t>();
        if (buffer.size() >= size) {
          const std::pair<int, std::string> packet{buffer[4], buffer.substr(5, size - 5)};
          buffer.erase(0, size);
          return packet;
        }
      }
      if (!More()) throw std::runtime_error("closed in the middle of a packet");
    }
  }
  std::string buffer;

 private:
  static constexpr double kPackageS = 0.002;
  int fd_;
};

// An RTDE client that follows phase, program, runtime state and safety mode, and beats. `clock`: a manual one, which it
// moves.
class TouchClient {
 public:
  explicit TouchClient(int port, const std::string& more_outputs = "", SimClock* the_clock = nullptr)
      : client(port), clock(the_clock) {
    client.RtdeReply('V', std::string("\0\2", 2));
    WireWriter outputs;
    outputs.Put(500.0).Text(
        "timestamp,output_int_register_24,output_int_register_25,runtime_state,safety_mode,robot_mode,actual_"
        "TCP_pose," +
        more_outputs);
    types = client.RtdeReply('O', outputs.bytes).substr(1);
    client.RtdeReply('I', "input_int_register_24");
    client.RtdeReply('I', "input_int_register_25");
    client.RtdeReply('S', "");
  }
  void Beat() { Write(1, ++beats); }
  void Command(int32_t value) { Write(2, value); }
  void Write(uint8_t recipe, int32_t value) {
    WireWriter to;
    to.Put(recipe).Put(value);
    client.Send(RtdeMessage('U', to.bytes));
  }
  void Next() {
    for (;;) {
      const auto [type, payload] = client.Rtde(clock);
      if (type != 'U') continue;
      WireReader from(payload);
      from.Get<uint8_t>();
      timestamp_s = from.Get<double>();
      program = from.Get<int32_t>();
      phase = from.Get<int32_t>();
      runtime_state = from.Get<uint32_t>();
      safety_mode = from.Get<int32_t>();
      robot_mode = from.Get<int32_t>();
      for (double& number : pose) number = from.Get<double>();
      rest = std::string(from.left);
      return;
    }
  }
  // Follows the data, beating, until `done`; throws after 30 s of host time.
  template <typename Done>
  void Until(Done done, bool beat = true) {
    for (const double begin_s = HostNowS(); !done();) {
      if (HostNowS() > begin_s + 30) throw std::runtime_error("it did not happen within 30 s");
      Next();
      if (beat) Beat();
    }
  }
  TestClient client;
  SimClock* const clock;
  std::string types, rest;
  int32_t beats = 0, program = 0, phase = 0, safety_mode = 0, robot_mode = 0;
  uint32_t runtime_state = 0;
  double timestamp_s = 0;
  std::array<double, 6> pose{};
};

}  // namespace touchstone::rig
