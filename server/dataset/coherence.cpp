#include "server/dataset/coherence.h"

#ifdef __BMI2__
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

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

struct Quantiser {
  double lower, factor;
  Quantiser(double least, double most) : lower(least), factor(most > least ? 255.999 / (most - least) : 0) {}
  uint64_t operator()(double value) const { return static_cast<uint64_t>((value - lower) * factor); }
};

}  // namespace

void CoherentOrder(absl::Span<const TouchPose> poses, CoherenceScratch* scratch,
                   std::vector<uint32_t>* order) {
  const size_t n = poses.size();
  order->resize(n);
  std::iota(order->begin(), order->end(), 0);
  if (n < 32) return;

  // Morton keys over the box of starts and targets and the sphere of laterals.
  Eigen::Array3d start_least, start_most, target_least, target_most;
  start_least = target_least = Eigen::Array3d::Constant(INFINITY);
  start_most = target_most = Eigen::Array3d::Constant(-INFINITY);
  for (const TouchPose& pose : poses) {
    const Eigen::Array3d start = pose.target_m - pose.approach * pose.standoff_m;
    start_least = start_least.min(start), start_most = start_most.max(start);
    target_least = target_least.min(pose.target_m.array()),
    target_most = target_most.max(pose.target_m.array());
  }
  const Quantiser sx(start_least[0], start_most[0]), sy(start_least[1], start_most[1]),
      sz(start_least[2], start_most[2]);
  const Quantiser tx(target_least[0], target_most[0]), ty(target_least[1], target_most[1]),
      tz(target_least[2], target_most[2]);
  const Quantiser unit(-1, 1);
  std::vector<uint64_t>& keys = scratch->keys;
  keys.resize(n);
  uint64_t varying = 0;
  for (size_t k = 0; k < n; ++k) {
    const TouchPose& pose = poses[k];
    const Eigen::Vector3d start = pose.target_m - pose.approach * pose.standoff_m;
    keys[k] = Spread(sx(start.x())) << 7 | Spread(sy(start.y())) << 6 | Spread(sz(start.z())) << 5 |
              Spread(tx(pose.target_m.x())) << 4 | Spread(ty(pose.target_m.y())) << 3 |
              Spread(tz(pose.target_m.z())) << 2 | Spread(unit(pose.lateral.x())) << 1 |
              Spread(unit(pose.lateral.z()));
    varying |= keys[k] ^ keys[0];
  }

  // Only bits that vary are sorted by, the highest 33 of them, eleven a pass.
  const int bits = __builtin_popcountll(varying);
  const int used = std::min(bits, 33);
  for (uint64_t& key : keys) key = Compress(key, varying) >> (bits - used);
  scratch->keys_swap.resize(n);
  scratch->order_swap.resize(n);
  for (int shift = 0; shift < used; shift += 11) {
    std::array<uint32_t, 2048> begin{};
    for (uint64_t key : keys) ++begin[(key >> shift) & 2047];
    uint32_t sum = 0;
    for (uint32_t& count : begin) sum += std::exchange(count, sum);
    for (size_t k = 0; k < n; ++k) {
      const uint32_t place = begin[(keys[k] >> shift) & 2047]++;
      scratch->keys_swap[place] = keys[k];
      scratch->order_swap[place] = (*order)[k];
    }
    keys.swap(scratch->keys_swap);
    order->swap(scratch->order_swap);
  }
}

}  // namespace touchstone
