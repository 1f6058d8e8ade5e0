// Noise with memory: a stationary Gauss-Markov process (Ornstein-Uhlenbeck) that can be asked for at any time, in any
// order, by any thread.
#pragma once

#include <cstdint>

namespace touchstone::touch {

// Mean 0, variance 1, correlation exp(-|t - u|) between times t and u (session time over correlation time); one path
// per seed and finger. Levy's midpoint construction with the process's own bridge: at cells of 32 correlation times
// the path is drawn independently (exp(-32) is nothing); between a and b, h apart from their middle each, with
// rho = exp(-h),
//   x(middle) = rho (x(a) + x(b)) / (1 + rho^2) + sqrt((1 - rho^2) / (1 + rho^2)) z,   z standard normal
// z is a pure function of (seed, finger, cell, node of the tree), so a value depends on no other touch and on no
// batch. Below 1/4096 of a correlation time the path is a straight line. `time` >= 0.
double GaussMarkov(uint64_t seed, int finger, double time);

}  // namespace touchstone::touch
