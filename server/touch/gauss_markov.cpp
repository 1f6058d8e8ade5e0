#include "server/touch/gauss_markov.h"

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::touch {
namespace {

constexpr double kCell = 32;  // correlation times
constexpr int kLevels = 17;

// Node 0 is the left end of a cell, 1 its middle, 2n and 2n + 1 the middles left and right of node n.
double NodeDeviate(uint64_t seed, int finger, uint64_t cell, uint64_t node) {
  return RandomStream(seed, RandomDomain::kNoiseMemory, cell, static_cast<uint64_t>(finger) << 32 | node)
      .Normal();
}

}  // namespace

double GaussMarkov(uint64_t seed, int finger, double time) {
  const double whole = std::floor(time / kCell);
  const auto cell = static_cast<uint64_t>(whole);
  double left = NodeDeviate(seed, finger, cell, 0), right = NodeDeviate(seed, finger, cell + 1, 0);
  double begin = whole * kCell, width = kCell;
  uint64_t node = 1;
  for (int level = 0; level < kLevels; ++level) {
    const double half = 0.5 * width, rho = std::exp(-half), square = rho * rho;
    const double middle = rho * (left + right) / (1 + square) +
                          std::sqrt((1 - square) / (1 + square)) * NodeDeviate(seed, finger, cell, node);
    const bool to_right = time >= begin + half;
    (to_right ? left : right) = middle;
    if (to_right) begin += half;
    width = half;
    node = 2 * node + to_right;
  }
  return left + (right - left) * (time - begin) / width;
}

}  // namespace touchstone::touch
