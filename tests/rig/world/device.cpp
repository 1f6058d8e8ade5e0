#include "tests/rig/world/device.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

namespace touchstone::rig {
namespace {

constexpr double kTurnHostS = 0.001;  // OnTime wants to be called so often
constexpr double kLookAgainS = 2e-4;  // whether the time that stood goes on

}  // namespace

Device::Device(const DeviceOptions& options, SimClock* clock, Faults* faults)
    : options_(options), clock_(clock), faults_(faults), random_(hidden::Stream(options.seed, "device")) {
  if (options.fingers < 1 || options.fingers > firmware::kMaxFingers)
    throw std::invalid_argument("the device has " + std::to_string(options.fingers) +
                                " fingers; must be 1 to " + std::to_string(firmware::kMaxFingers));
  Pins::Sink sink;
  sink.edge = [this](int finger, bool level, double at_s) {
    core_->OnEdge(finger, level, counter_->ReadingAt(at_s));
  };
  sink.sample = [this](int finger, uint16_t value, double at_s) {
    core_->OnAnalogue(finger, value, counter_->ReadingAt(at_s));
  };
  pins_ = std::make_unique<Pins>(options.sensor, options.fingers, random_(), std::move(sink));
  line_ = std::make_unique<SerialLine>(options.link, options.byte_s, random_(), faults);
  wake_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_ < 0) throw std::runtime_error("cannot make an eventfd");
  Boot();
  part_ = std::make_unique<SimClock::Part>(clock, [this] { Wake(); });
  thread_ = std::thread([this] { Run(); });
}

Device::~Device() {
  stopping_ = true;
  Wake();
  thread_.join();
  part_.reset();
  close(wake_);
}

void Device::Wake() {
  const uint64_t one = 1;
  if (write(wake_, &one, sizeof one) < 0) return;  // already awake
}

void Device::OnEdge(const Edge& edge) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    edges_.push_back(edge);
  }
  Wake();
}

void Device::Reset() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    reset_ = true;
  }
  Wake();
}

double Device::TicksAt(double sim_s) const {
  std::lock_guard<std::mutex> lock(mutex_);
  return oscillator_->TicksAt(sim_s);
}

void Device::Boot() {
  // The counter begins anywhere in the first quarter of its turn.
  counter_ =
      std::make_shared<Oscillator>(options_.tick_hz, options_.drift_ppm + faults_->Get("clock_drift_ppm"),
                                   random_() % (uint64_t{1} << 30), clock_->NowS());
  firmware::Identity identity;
  identity.boot_id = static_cast<uint32_t>(random_()) | 1;
  identity.tick_hz = static_cast<uint32_t>(std::lround(options_.tick_hz));
  identity.tick_bits = 32;
  identity.firmware = "rig-emulator 0.1.0";
  {
    std::lock_guard<std::mutex> lock(mutex_);
    oscillator_ = counter_;
  }
  boot_id_ = identity.boot_id;
  core_ = std::make_unique<firmware::Effector>(
      identity,
      [](void* self, const uint8_t* frame, size_t size) {
        auto* device = static_cast<Device*>(self);
        device->line_->Write(frame, size, device->clock_->NowS());
      },
      [](void* self) {
        auto* device = static_cast<Device*>(self);
        return device->counter_->ReadingAt(device->frozen_s_.value_or(device->clock_->NowS()));
      },
      this);
  pins_->Repeat(clock_->NowS());
}

void Device::Plugging() {
  const bool away = faults_->UntilHostS("unplug") > 0;
  if (away && line_->plugged()) {
    line_->Unplug();
  } else if (!away && !line_->plugged()) {
    line_->Plug();
    if (options_.unplug_resets) Boot();
  }
}

// What the sensors showed until now.
void Device::TakeEdges() {
  std::vector<Edge> edges;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    edges.swap(edges_);
  }
  const bool bounce = faults_->Get("bounce") > 0;
  for (const Edge& edge : edges) pins_->Add(edge, bounce);
  const double now_s = clock_->NowS();
  counter_->SetDriftPpm(options_.drift_ppm + faults_->Get("clock_drift_ppm"), now_s);
  pins_->Run(now_s, static_cast<int>(faults_->Get("stuck_finger")));
  // For debouncing it is as late as the edges are that it has been told, however long this thread was away.
  frozen_s_ = now_s;
  core_->OnTime();
  frozen_s_.reset();
}

void Device::Run() {
  while (!stopping_) {
    bool reset = false;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      std::swap(reset, reset_);
    }
    const double now_s = clock_->NowS();
    if (reset) Boot();
    Plugging();
    TakeEdges();
    // Once more for what the core writes in answer, which leaves at once.
    for (int turn = 0; turn < 2; ++turn) {
      const std::vector<uint8_t> bytes = line_->Exchange(clock_->NowS());
      // An edge interrupts a microcontroller at once: nothing that arrives later is answered before it, however long
      // this thread was away in between.
      if (!bytes.empty()) TakeEdges();
      for (const uint8_t byte : bytes) core_->OnByte(byte);
    }
    // A manual clock is moved by who reads.
    if (clock_->manual() || !patience_.WaitsFor(line_->Unread())) part_->Done(now_s);
    Wait();
  }
}

void Device::Wait() {
  const double due_s = std::min(pins_->NextDueS(), line_->NextDueS());
  const double wait_s = std::clamp((due_s - clock_->NowS()) / clock_->speedup(),
                                   clock_->Stands() ? kLookAgainS : 0.0, kTurnHostS);
  pollfd fds[2] = {{wake_, POLLIN, 0}, {line_->fd(), POLLIN, 0}};  // a negative one is passed over
  const timespec wait{0, static_cast<long>(wait_s * 1e9)};
  ppoll(fds, 2, &wait, nullptr);
  if (fds[0].revents != 0) {
    uint64_t count;
    if (read(wake_, &count, sizeof count) < 0) return;
  }
}

}  // namespace touchstone::rig
