// The firmware's core behind a pseudo-terminal, with a line that can be bad. A test tool.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "firmware/core/effector.h"
#include "server/base/numbers/random.h"
#include "server/base/test_folder.h"

namespace touchstone::gateway::effector {

class FakeDevice {
 public:
  struct Options {
    uint32_t boot_id = 1001;
    double ticks_per_s = 1e6;  // of host time
    uint32_t first_tick = 5000;
    int answers_with_version = 0;  // to Hello; 0: as the core does
  };
  struct Line {
    double drop = 0, corrupt = 0, duplicate = 0;  // probabilities a byte, both ways
  };

  FakeDevice() : FakeDevice(Options()) {}
  explicit FakeDevice(const Options& options);
  ~FakeDevice();

  const std::string& port() const { return port_; }  // stays the same over Unplug and Plug
  void SetLine(const Line& line);
  void Mute(bool mute);  // neither hears nor says anything
  void Unplug();
  void Plug();
  void Reset(uint32_t boot_id);  // and the counter begins anew

  // An edge now; its ticks in 64 bits, the truth.
  uint64_t Press(int finger) { return Edge(finger, true); }
  uint64_t Release(int finger) { return Edge(finger, false); }
  uint64_t NowTicks() const;
  // Bytes to the host as they are, faults apart.
  void Inject(const std::vector<uint8_t>& bytes);
  template <typename Message>
  void InjectMessage(const Message& message) {
    uint8_t payload[firmware::kMaxPayload], frame[firmware::kMaxFrame];
    const size_t size = firmware::EncodeFrame(payload, firmware::Encode(message, payload), frame);
    Inject(std::vector<uint8_t>(frame, frame + size));
  }
  // A message to the device that does not come over the line.
  template <typename Message>
  void Tell(const Message& message) {
    uint8_t payload[firmware::kMaxPayload], frame[firmware::kMaxFrame];
    const size_t size = firmware::EncodeFrame(payload, firmware::Encode(message, payload), frame);
    std::lock_guard<std::mutex> lock(mutex_);
    core_->OnByte(0);
    for (size_t i = 0; i < size; ++i) core_->OnByte(frame[i]);
  }
  // How often the host acknowledged this event, and armed.
  int Acknowledged(uint32_t number) const;
  int hellos() const;
  // How many statuses it sent.
  int statuses() const;

 private:
  uint64_t Edge(int finger, bool level);
  void StartCore();
  void Run();
  void Hear(uint8_t byte);
  void WriteRaw(const uint8_t* data, size_t size);
  void WriteFrame(const uint8_t* frame, size_t size);

  Options options_;
  const TestFolder folder_;
  const std::string port_;
  mutable std::mutex mutex_;
  int master_ = -1;
  bool stopping_ = false, mute_ = false;
  Line line_;
  RandomStream random_{7, RandomDomain::kTest};
  double began_host_s_ = 0;
  std::unique_ptr<firmware::Effector> core_;
  firmware::FrameParser heard_;
  std::vector<uint32_t> acknowledged_;
  int hellos_ = 0, statuses_ = 0;
  std::thread thread_;
};

}  // namespace touchstone::gateway::effector
