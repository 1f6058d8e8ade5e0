#include "tests/rig/world/oscillator.h"

#include <algorithm>
#include <cmath>

namespace touchstone::rig {
namespace {

constexpr size_t kMaxPieces = 64;

}  // namespace

Oscillator::Oscillator(double tick_hz, double drift_ppm, uint64_t begin_ticks, double now_s)
    : tick_hz_(tick_hz) {
  pieces_.push_back({now_s, static_cast<double>(begin_ticks), tick_hz * (1 + drift_ppm * 1e-6)});
}

void Oscillator::SetDriftPpm(double drift_ppm, double now_s) {
  const double ticks = TicksAt(now_s), ticks_per_s = tick_hz_ * (1 + drift_ppm * 1e-6);
  std::lock_guard<std::mutex> lock(mutex_);
  if (pieces_.back().ticks_per_s == ticks_per_s) return;
  pieces_.push_back({now_s, ticks, ticks_per_s});
  if (pieces_.size() > kMaxPieces) pieces_.erase(pieces_.begin());
}

double Oscillator::TicksAt(double sim_s) const {
  std::lock_guard<std::mutex> lock(mutex_);
  size_t k = pieces_.size() - 1;
  while (k > 0 && pieces_[k].from_s > sim_s) --k;
  return pieces_[k].ticks + (sim_s - pieces_[k].from_s) * pieces_[k].ticks_per_s;
}

uint32_t Oscillator::ReadingAt(double sim_s) const {
  return static_cast<uint32_t>(static_cast<uint64_t>(std::floor(std::max(0.0, TicksAt(sim_s)))));
}

}  // namespace touchstone::rig
