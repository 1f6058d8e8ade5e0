#include "server/dataset/coherence.h"

#ifdef __BMI2__
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace touchstone::dataset {
namespace {

constexpr int kBitsPerDimension = 8;
constexpr int kDimensions = 8;  // start, target: x y z each; lateral: octahedral u v

// Bit b of `value` to bit b * 8 of the result.
inline uint64_t Spread(uint64_t value) {
#ifdef __BMI2__
  return _pdep_u64(value, 0x0101010101010101ull);
#else
  uint64_t spread = 0;
  for (int bit = 0; bit < kBitsPerDimension; ++bit) spread |= ((value >> bit) & 1) << (bit * kDimensions);
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
inline uint64_t CoherentOrder::Range::Quantise(double value) const {
  const double scaled = (value - lower) * factor;
  return static_cast<uint32_t>(static_cast<int32_t>(std::min(std::max(scaled, 0.0), 255.0)));
}

void CoherentOrder::Begin(absl::Span<const touch::TouchPose> sample) {
  keys_.clear();
  for (int axis = 0; axis < 3; ++axis) {
    double start_min = INFINITY, start_max = -INFINITY, target_min = INFINITY, target_max = -INFINITY;
    for (const touch::TouchPose& pose : sample) {
      const double start = pose.target_m[axis] - pose.approach[axis] * pose.standoff_m;
      start_min = std::min(start_min, start), start_max = std::max(start_max, start);
      target_min = std::min(target_min, pose.target_m[axis]);
      target_max = std::max(target_max, pose.target_m[axis]);
    }
    start_[axis] = {start_min, start_max > start_min ? 255.999 / (start_max - start_min) : 0};
    target_[axis] = {target_min, target_max > target_min ? 255.999 / (target_max - target_min) : 0};
  }
}

void CoherentOrder::Add(absl::Span<const touch::TouchPose> poses) {
  const Range lateral = {-1, 127.999};
  const size_t before = keys_.size();
  keys_.resize(before + poses.size());
  for (size_t k = 0; k < poses.size(); ++k) {
    const touch::TouchPose& pose = poses[k];
    uint64_t key =
        Spread(lateral.Quantise(pose.lateral.x())) << 1 | Spread(lateral.Quantise(pose.lateral.z()));
    for (int axis = 0; axis < 3; ++axis) {
      const double start = pose.target_m[axis] - pose.approach[axis] * pose.standoff_m;
      key |= Spread(start_[axis].Quantise(start)) << (7 - axis);
      key |= Spread(target_[axis].Quantise(pose.target_m[axis])) << (4 - axis);
    }
    keys_[before + k] = key;
  }
}

absl::Span<const uint32_t> CoherentOrder::Sort() {
  const size_t n = keys_.size();
  // Only bits that vary are sorted by, the highest 32 of them, eleven a pass; a pose's number follows them in
  // the word that is moved.
  uint64_t varying = 0;
  for (uint64_t key : keys_) varying |= key ^ keys_[0];
  const int bits = __builtin_popcountll(varying);
  const int used = std::min(bits, 32);
  constexpr int kPasses = 3, kBitsPerPass = 11, kBuckets = 1 << kBitsPerPass;
  std::array<std::array<uint32_t, kBuckets>, kPasses> begin{};
  for (size_t k = 0; k < n; ++k) {
    const uint64_t key = Compress(keys_[k], varying) >> (bits - used);
    for (int pass = 0; pass < kPasses; ++pass) ++begin[pass][(key >> (kBitsPerPass * pass)) % kBuckets];
    keys_[k] = key << 32 | k;
  }
  keys_swap_.resize(n);
  for (int pass = 0; kBitsPerPass * pass < used; ++pass) {
    uint32_t sum = 0;
    for (uint32_t& count : begin[pass]) sum += std::exchange(count, sum);
    for (uint64_t key : keys_)
      keys_swap_[begin[pass][(key >> (32 + kBitsPerPass * pass)) % kBuckets]++] = key;
    keys_.swap(keys_swap_);
  }
  order_.resize(n);
  for (size_t k = 0; k < n; ++k) order_[k] = static_cast<uint32_t>(keys_[k]);
  return order_;
}

}  // namespace touchstone::dataset
