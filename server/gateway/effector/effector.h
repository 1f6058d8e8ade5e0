// The end effector: contact times of the fingers over a serial line (firmware/PROTOCOL.md).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "firmware/core/messages.h"
#include "server/gateway/timing/change_notifier.h"
#include "server/gateway/timing/clock_sync.h"

namespace touchstone::gateway::effector {

// "optical", "microswitch" or "resistor". INVALID_ARGUMENT begins with `where`.
absl::StatusOr<firmware::Sensor> ParseSensor(const std::string& name, const std::string& where);

struct EffectorFinger {
  firmware::Sensor sensor = firmware::Sensor::kOptical;
  bool active_high = true;
  double debounce_s = 0.005;             // microswitch
  int threshold = 512, hysteresis = 16;  // resistor, ADC counts
};

struct EffectorOptions {
  std::string port;  // "/dev/ttyACM0"
  int baud = 115200;
  std::vector<EffectorFinger> fingers = std::vector<EffectorFinger>(3);
  double reply_timeout_s = 0.05;  // of one try, well within the period of the arm's watchdog; tried 60 times
  double silence_s = 1.0;         // without a heartbeat: the line is lost
  // Between two queries of its clock: among more of them there are shorter delays. At 0.02 the queries and their answers
  // take a fifth of a line of 115200 baud.
  double clock_query_s = 0.02;
  double time_scale = 1;  // rig seconds in one host second
};

// The contacts of one touch so far. Times in ticks of the device's clock (tick_hz), 64 bits.
struct EffectorTouch {
  uint32_t touch = 0;
  uint32_t boot_id = 0;
  uint64_t armed_ticks = 0;
  std::vector<std::optional<uint64_t>> contact_ticks;  // per finger; none: no contact yet
  // Per finger, when it let go first after its contact; none: not yet, or not known (of a record that was recalled).
  std::vector<std::optional<uint64_t>> release_ticks;
  uint32_t pressed_mask =
      0;  // bit per finger: pressed when the capture had ended and every finger had time to let go
  int Contacts() const;
};
// "finger 2", "fingers 1, 3": as people count them.
std::string FingersText(uint32_t mask);

struct EffectorState {
  bool connected = false;
  std::string why;       // if not connected
  std::string firmware;  // "nano33ble 0.1.0"
  uint32_t boot_id = 0;
  uint32_t tick_hz = 0;
  std::vector<bool> pressed;
  uint64_t bad_frames = 0, repeated_events = 0, reconnections = 0;
};

// A thread of its own reads the line, acknowledges, keeps the clock, and opens the port again when it was
// lost. All functions may be called from any thread.
class Effector {
 public:
  // Opens the port and agrees on version and fingers; keeps trying in the background if nothing answers.
  static absl::StatusOr<std::unique_ptr<Effector>> Open(EffectorOptions options,
                                                        timing::ChangeNotifier* changes);
  virtual ~Effector() = default;

  // Starts the capture of a touch's contacts (id above 0) and returns once the device has confirmed it.
  // FAILED_PRECONDITION names the fingers that are pressed already; UNAVAILABLE: the line is lost. `guard` (null: none)
  // is asked every 10 ms meanwhile, from this thread; its error ends the wait, and is returned.
  virtual absl::Status StartCapture(uint32_t touch, const std::function<absl::Status()>& guard = nullptr) = 0;
  // Ends it, and waits until the device's record of the touch is known, and until no finger is pressed any more, or should
  // not be (half a second and twice its debounce time): the tool has left the object before. The time at which a finger
  // let go is waited for in four repetitions of its event.
  virtual absl::Status EndCapture() = 0;
  // The contacts of the current or last capture; changes->Notify() after every change. UNAVAILABLE if the line
  // was lost since, or the device was reset, in which case its record is gone.
  virtual absl::StatusOr<EffectorTouch> Touch() const = 0;
  // Asks the device for the record of that touch, as after a restart of this process. NOT_FOUND: it
  // has another one.
  virtual absl::StatusOr<EffectorTouch> Recall(uint32_t touch) = 0;

  virtual EffectorState State() const = 0;
  virtual timing::ClockEstimate Clock() const = 0;  // device seconds on host seconds
};

}  // namespace touchstone::gateway::effector
