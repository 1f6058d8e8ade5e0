#include "server/dataset/coherence.h"

#ifdef __BMI2__
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace touchstone {
namespace {

constexpr int kBitsADimension = 8;
constexpr int kDimensions = 8;  // start, target: x y z each; lateral: octahedral u v

// Bit b of `value` to bit b * 8 of the result.
inline uint64_t Spread(uint64_t value) {
#ifdef __BMI2__
  return _pdep_u64(value, 0x0101010101010101ull);
#else
  uint64_t spread = 0;
  for (int bit = 0; bit < kBitsADimension; ++bit) spread |= ((value >> bit) & 1) << (bit * kDimensions);
  return spread;
#endif
}

// The bits of `value` under `mask`, pushed together at the low end.
inline uint64_t Compress(uint64_t value, uint64_t mask) {
#ifdef __BMI2__
  return _pext_u64(value, mask);
#else
  uint64_t compressed = 0;
  for (int target = 0; mask != 0; mask &= mask - 1, ++target)
    compressed |= ((value >> __builtin_ctzll(mask)) & 1) << target;
  return compressed;
#endif
}

}  // namespace

// Poses beyond the sample's range share its border: that costs coherence, never a result.
uint64_t CoherentOrder::Range::Quantise(double value) const {
  return static_cast<uint64_t>(std::clamp((value - lower) * factor, 0.0, 255.0));
}

void CoherentOrder::Begin(absl::Span<const TouchPose> sample) {
  keys_.clear();
  for (int axis = 0; axis < 3; ++axis) {
    double start_least = INFINITY, start_most = -INFINITY, target_least = INFINITY, target_most = -INFINITY;
    for (const TouchPose& pose : sample) {
      const double start = pose.target_m[axis] - pose.approach[axis] * pose.standoff_m;
      start_least = std::min(start_least, start), start_most = std::max(start_most, start);
      target_least = std::min(target_least, pose.target_m[axis]);
      target_most = std::max(target_most, pose.target_m[axis]);
    }
    start_[axis] = {start_least, start_most > start_least ? 255.999 / (start_most - start_least) : 0};
    target_[axis] = {target_least, target_most > target_least ? 255.999 / (target_most - target_least) : 0};
  }
}

void CoherentOrder::Add(absl::Span<const TouchPose> poses) {
  const Range lateral = {-1, 127.999};
  for (const TouchPose& pose : poses) {
    uint64_t key =
        Spread(lateral.Quantise(pose.lateral.x())) << 1 | Spread(lateral.Quantise(pose.lateral.z()));
    for (int axis = 0; axis < 3; ++axis) {
      const double start = pose.target_m[axis] - pose.approach[axis] * pose.standoff_m;
      key |= Spread(start_[axis].Quantise(start)) << (7 - axis);
      key |= Spread(target_[axis].Quantise(pose.target_m[axis])) << (4 - axis);
    }
    keys_.push_back(key);
  }
}

absl::Span<const uint32_t> CoherentOrder::Sort() {
  const size_t n = keys_.size();
  order_.resize(n);
  std::iota(order_.begin(), order_.end(), 0);

  // Only bits that vary are sorted by, the highest 33 of them, eleven a pass.
  uint64_t varying = 0;
  for (uint64_t key : keys_) varying |= key ^ keys_[0];
  const int bits = __builtin_popcountll(varying);
  const int used = std::min(bits, 33);
  for (uint64_t& key : keys_) key = Compress(key, varying) >> (bits - used);
  keys_swap_.resize(n);
  order_swap_.resize(n);
  for (int shift = 0; shift < used; shift += 11) {
    std::array<uint32_t, 2048> begin{};
    for (uint64_t key : keys_) ++begin[(key >> shift) & 2047];
    uint32_t sum = 0;
    for (uint32_t& count : begin) sum += std::exchange(count, sum);
    for (size_t k = 0; k < n; ++k) {
      const uint32_t place = begin[(keys_[k] >> shift) & 2047]++;
      keys_swap_[place] = keys_[k];
      order_swap_[place] = order_[k];
    }
    keys_.swap(keys_swap_);
    order_.swap(order_swap_);
  }
  return order_;
}

}  // namespace touchstone
