// The emulated end effector: the firmware's own core, on an emulated counter, pins and serial line. A thread
// of its own runs it; contacts are stamped with the moment at which they happened, as hardware capture does,
// whenever that thread comes to them.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "firmware/core/effector.h"
#include "tests/rig/controller/network/unread.h"
#include "tests/rig/world/oscillator.h"
#include "tests/rig/world/pins.h"
#include "tests/rig/world/serial_line.h"

namespace touchstone::rig {

struct DeviceOptions {
  std::string link;  // the port: a symbolic link to a pseudo-terminal
  int fingers = 3;
  std::string sensor = "optical";  // "optical", "microswitch", "resistor"; pressed is a high level
  double tick_hz = 16e6;           // of its counter, 32 bits
  double drift_ppm = 0;            // of its oscillator; the fault clock_drift_ppm is added
  double byte_s = 0;               // simulated time of a byte on the line; 10 / 115200 for a true UART
  bool unplug_resets = false;      // it takes its power from the line
  uint64_t seed = 1;
};

class Device {
 public:
  // Throws std::runtime_error or std::invalid_argument.
  Device(const DeviceOptions& options, SimClock* clock, Faults* faults);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void OnEdge(const Edge& edge);  // any thread
  void Reset();                   // any thread: another boot id, everything forgotten
  uint32_t boot_id() const { return boot_id_; }
  // The truth of its clock: counts since it began, without wrap-around.
  double TicksAt(double sim_s) const;
  double tick_hz() const { return options_.tick_hz; }

 private:
  void TakeEdges();
  void Run();
  void Boot();
  void Plugging();
  void Wait();
  void Wake();

  const DeviceOptions options_;
  SimClock* const clock_;
  Faults* const faults_;

  mutable std::mutex mutex_;  // of what other threads see
  std::vector<Edge> edges_;
  bool reset_ = false;
  std::shared_ptr<Oscillator> oscillator_;
  std::atomic<uint32_t> boot_id_{0};
  std::atomic<bool> stopping_{false};

  // The thread's own.
  std::mt19937_64 random_;
  std::shared_ptr<Oscillator> counter_;  // the same oscillator
  std::unique_ptr<Pins> pins_;
  std::unique_ptr<SerialLine> line_;
  std::unique_ptr<firmware::Effector> core_;
  std::optional<double> frozen_s_;  // what the core takes for now
  int wake_ = -1;                   // eventfd
  ReaderPatience patience_;
  std::unique_ptr<SimClock::Part> part_;
  std::thread thread_;
};

}  // namespace touchstone::rig
