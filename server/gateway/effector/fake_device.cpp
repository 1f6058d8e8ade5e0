#include "server/gateway/effector/fake_device.h"

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>

#include <gtest/gtest.h>

#include "server/base/check.h"
#include "server/gateway/timing/change_notifier.h"

namespace touchstone::gateway::effector {

FakeDevice::FakeDevice(const Options& options) : options_(options), port_(folder_.Path("port")) {
  StartCore();
  Plug();
  thread_ = std::thread([this] { Run(); });
}

FakeDevice::~FakeDevice() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  thread_.join();
  if (master_ >= 0) Unplug();
}

void FakeDevice::StartCore() {
  began_host_s_ = timing::HostNowS();
  firmware::Identity identity;
  identity.boot_id = options_.boot_id;
  identity.tick_hz = 1000000;
  identity.firmware = "fake 1.2.3";
  core_ = std::make_unique<firmware::Effector>(
      identity,
      [](void* context, const uint8_t* frame, size_t size) {
        static_cast<FakeDevice*>(context)->WriteFrame(frame, size);
      },
      [](void* context) { return static_cast<uint32_t>(static_cast<FakeDevice*>(context)->NowTicks()); },
      this);
  core_->OnTime();  // the counter's first turn begins
}

uint64_t FakeDevice::NowTicks() const {
  return options_.first_tick +
         static_cast<uint64_t>((timing::HostNowS() - began_host_s_) * options_.ticks_per_s);
}

void FakeDevice::SetLine(const Line& line) {
  std::lock_guard<std::mutex> lock(mutex_);
  line_ = line;
}

void FakeDevice::Mute(bool mute) {
  std::lock_guard<std::mutex> lock(mutex_);
  mute_ = mute;
}

void FakeDevice::Unplug() {
  std::lock_guard<std::mutex> lock(mutex_);
  unlink(port_.c_str());
  close(master_);
  master_ = -1;
}

void FakeDevice::Plug() {
  std::lock_guard<std::mutex> lock(mutex_);
  master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  TOUCHSTONE_CHECK(master_ >= 0 && grantpt(master_) == 0 && unlockpt(master_) == 0);
  char name[128];
  TOUCHSTONE_CHECK(ptsname_r(master_, name, sizeof name) == 0);
  // Raw from the start: nothing is echoed before the host opens it.
  const int slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios settings;
  TOUCHSTONE_CHECK(slave >= 0 && tcgetattr(slave, &settings) == 0);
  cfmakeraw(&settings);
  tcsetattr(slave, TCSANOW, &settings);
  close(slave);
  TOUCHSTONE_CHECK(symlink(name, port_.c_str()) == 0);
}

void FakeDevice::Reset(uint32_t boot_id) {
  std::lock_guard<std::mutex> lock(mutex_);
  options_.boot_id = boot_id;
  StartCore();
}

uint64_t FakeDevice::Edge(int finger, bool level) {
  std::lock_guard<std::mutex> lock(mutex_);
  const uint64_t ticks = NowTicks();
  core_->OnEdge(finger, level, static_cast<uint32_t>(ticks));
  return ticks;
}

void FakeDevice::Inject(const std::vector<uint8_t>& bytes) {
  std::lock_guard<std::mutex> lock(mutex_);
  WriteRaw(bytes.data(), bytes.size());
}

int FakeDevice::Acknowledged(uint32_t number) const {
  std::lock_guard<std::mutex> lock(mutex_);
  return static_cast<int>(std::count(acknowledged_.begin(), acknowledged_.end(), number));
}

int FakeDevice::hellos() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return hellos_;
}

int FakeDevice::statuses() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return statuses_;
}

void FakeDevice::Run() {
  while (true) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (stopping_) return;
      uint8_t bytes[256];
      const ssize_t size = master_ >= 0 ? read(master_, bytes, sizeof bytes) : 0;
      for (ssize_t i = 0; i < size; ++i) {
        if (mute_ || random_.Uniform() < line_.drop) continue;
        if (random_.Uniform() < line_.corrupt) bytes[i] = static_cast<uint8_t>(random_.Below(256));
        Hear(bytes[i]);
        if (random_.Uniform() < line_.duplicate) Hear(bytes[i]);
      }
      core_->OnTime();
    }
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
}

void FakeDevice::Hear(uint8_t byte) {
  core_->OnByte(byte);
  if (!heard_.Push(byte)) return;
  firmware::Acknowledge acknowledge;
  firmware::Hello hello;
  if (firmware::Decode(heard_.payload(), heard_.size(), &acknowledge))
    acknowledged_.push_back(acknowledge.number);
  if (firmware::Decode(heard_.payload(), heard_.size(), &hello)) ++hellos_;
}

void FakeDevice::WriteFrame(const uint8_t* frame, size_t size) {
  firmware::FrameParser sent;
  firmware::Status status;
  for (size_t i = 0; i < size; ++i)
    if (sent.Push(frame[i]) && firmware::Decode(sent.payload(), sent.size(), &status)) ++statuses_;
  // A firmware of another release.
  if (options_.answers_with_version != 0) {
    firmware::FrameParser parser;
    firmware::HelloReply reply;
    for (size_t i = 0; i < size; ++i) {
      if (!parser.Push(frame[i]) || !firmware::Decode(parser.payload(), parser.size(), &reply)) continue;
      reply.version = static_cast<uint8_t>(options_.answers_with_version);
      uint8_t payload[firmware::kMaxPayload], other[firmware::kMaxFrame];
      return WriteRaw(other, firmware::EncodeFrame(payload, firmware::Encode(reply, payload), other));
    }
  }
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < size; ++i) {
    if (random_.Uniform() < line_.drop) continue;
    bytes.push_back(random_.Uniform() < line_.corrupt ? static_cast<uint8_t>(random_.Below(256)) : frame[i]);
    if (random_.Uniform() < line_.duplicate) bytes.push_back(bytes.back());
  }
  WriteRaw(bytes.data(), bytes.size());
}

void FakeDevice::WriteRaw(const uint8_t* data, size_t size) {
  if (mute_ || master_ < 0) return;
  // Nobody reads: the bytes are lost, as on a wire.
  (void)!write(master_, data, size);
}

}  // namespace touchstone::gateway::effector
