// What the parts of the emulated rig share: the simulated clock, and what the arm does to the fingers.
//
// The emulator is a test tool. What it reports was never measured on anything; nothing that it makes
// is called real.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "server/gateway/timing/paced_clock.h"

namespace touchstone::rig {

// Simulated seconds since the emulator began. They pass at most `speedup` times as fast as the host's steady clock, and
// only while every thread that takes part has done what was due until shortly before: what waits for the processor lets
// no time pass.
class SimClock {
 public:
  // How far time may be ahead of the part that is behind the others, host seconds.
  static constexpr double kAheadHostS = 0.004;

  // `file`: others follow it there (server/gateway/timing/paced_clock.h); empty: nobody does.
  explicit SimClock(double speedup = 1, const std::string& file = "");
  // Stands still but for MoveBy.
  struct Manual {};
  explicit SimClock(Manual, double speedup = 1);

  double NowS() const;
  // The seconds of the host that have counted: those of the steady clock when it began, and NowS() / speedup since.
  double HostS() const;
  double speedup() const { return speedup_; }
  // Time waits for a part.
  bool Stands() const;

  // Of a manual clock: lets time pass in steps, and returns when every part has done everything that was due by then.
  void MoveBy(double sim_s, double step_s = 0.002);
  bool manual() const { return manual_; }

  // A thread of the rig, which time waits for.
  class Part {
   public:
    // `wake` is called from another thread when a manual clock was moved.
    Part(SimClock* clock, std::function<void()> wake);
    ~Part();
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;
    // It has done everything that was due by then. Not later than kAheadHostS (times the speed-up) before a moment that
    // time must not pass until this part says so: time stands exactly there.
    void Done(double sim_s);
    // It is that time, and every other part has done everything that was due by then.
    bool OthersDone(double sim_s) const;

   private:
    friend class SimClock;
    SimClock* const clock_;
    const std::function<void()> wake_;
    double done_s_;
  };

 private:
  void SetUntil(double until_host_s);  // with mutex_
  void Move();                         // likewise: as far as the parts allow

  const double speedup_;
  const bool manual_;
  std::shared_ptr<gateway::timing::PacedClock> paced_;  // host seconds, as HostS()
  mutable std::mutex mutex_;
  std::condition_variable done_;
  std::vector<Part*> parts_;
};

// One straight motion of the tip, or the end of one, as the controller plans it. Base frame,
// SI, simulated time.
struct StraightMotion {
  uint64_t number = 0;  // counts all straight motions
  double start_s = 0;   // when the arm begins to move: it follows its target by the controller's lag
  Eigen::Isometry3d from = Eigen::Isometry3d::Identity();  // base_from_tip
  Eigen::Isometry3d to = Eigen::Isometry3d::Identity();
  double speed_m_s = 0, acceleration_m_s2 = 0;
};

// The controller reports the arm's motion to the fingers; they return how far they are indented. Called from the
// controller's thread only.
class TipListener {
 public:
  virtual ~TipListener() = default;
  // A straight motion has begun.
  virtual void OnMotionBegan(const StraightMotion& motion) = 0;
  // The motion has come so far along its line by now (m); called at every control cycle and exactly at its
  // end or stop. `distance_at` gives the distance at any time up to now, for the exact moment of a contact:
  // monotone. Returns how far the most pressed finger is pushed beyond its contact, m.
  virtual double OnProgress(uint64_t number, double now_s, double distance_m,
                            const std::function<double(double)>& distance_at) = 0;
  // It ended or was stopped; the arm rests.
  virtual void OnMotionEnded(uint64_t number, double now_s) = 0;
  // How far all fingers together are indented, m, as of the last progress.
  virtual double IndentationM() const { return 0; }
};

// Faults that can be switched on while it runs, by name, each with a number. Thread-safe.
//   part        name              number
//   line        drop_bytes        probability per byte
//               corrupt_bytes     probability per byte
//               duplicate_bytes   probability per byte
//               line_delay_ms     jitter, uniform from 0 to this
//               unplug            seconds of host time
//   fingers     stuck_finger      index; -1: none
//               missing_finger    index; -1: none
//               bounce            1: on
//               clock_drift_ppm   of the device's clock
//   controller  late_packets_ms   delay of state packets, up to
//               skip_packets      probability per packet
//               freeze            seconds of host time: accepts, but sends nothing and moves nothing
//               disconnect        1: closes every connection once
//               protective_stop   1: now
//               emergency_stop    1: pressed; 0: released
//               speed_scaling     0 to 1: what the trajectory limiter leaves of the commanded speed
//               speed_slider      0 to 1: the pendant's slider; moved when this number changes
//               local_control     1: the e-Series robot is in local control
//               finger_stiffness  N per mm of every finger's indentation, on the tip
//               force_offset_n    N downwards that a payload which is set wrong pretends
//   camera      stale_frame       1: repeats the last picture
//               camera_unplug     seconds of host time
class Faults {
 public:
  // Timed faults last so long on this clock (HostS); before: on the steady clock. It must live as long.
  void Follow(const SimClock* clock) { clock_ = clock; }
  static const std::vector<std::string>& Names();
  // INVALID names and numbers: an error text; empty if it was done.
  std::string Set(const std::string& name, double value);
  double Get(const std::string& name) const;
  // Takes a one-time fault: its value, and back to 0.
  double Take(const std::string& name);
  // Host seconds until which a timed fault (unplug, freeze, camera_unplug) lasts; 0:
  // it does not.
  double UntilHostS(const std::string& name) const;

 private:
  double HostS() const;

  const SimClock* clock_ = nullptr;
  mutable std::mutex mutex_;
  std::map<std::string, double> values_;
  std::map<std::string, double> until_host_s_;
};

}  // namespace touchstone::rig
