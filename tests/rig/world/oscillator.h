// The counter of the emulated device: its own oscillator, a little wrong, and wrapping at 32 bits.
#pragma once

#include <cstdint>
#include <mutex>
#include <vector>

namespace touchstone::rig {

class Oscillator {
 public:
  // Counts `tick_hz` (1 + drift_ppm / 1e6) times a simulated second, from `begin_ticks` at `now_s`.
  Oscillator(double tick_hz, double drift_ppm, uint64_t begin_ticks, double now_s);

  // From now_s on it drifts so; the count goes on without a step.
  void SetDriftPpm(double drift_ppm, double now_s);
  // Ticks at a simulated time, also one that is some while ago, without wrap-around. Thread-safe.
  double TicksAt(double sim_s) const;
  uint32_t ReadingAt(double sim_s) const;  // what the hardware would capture

 private:
  struct Piece {
    double from_s, ticks, ticks_per_s;
  };
  double tick_hz_;
  mutable std::mutex mutex_;
  std::vector<Piece> pieces_;  // one a change of drift
};

}  // namespace touchstone::rig
