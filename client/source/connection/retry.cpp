#include "client/source/connection/retry.h"

#include <algorithm>
#include <cmath>

namespace touchstone::client {
namespace {

constexpr double kMinLeftS = 1e-6;  // what is less is nothing to a clock of nanoseconds

}  // namespace

Retry::Retry(int servers, double retry_for_s, const Clock& clock)
    : servers_(std::max(1, servers)), retry_for_s_(retry_for_s), clock_(clock), since_(clock.Now()) {}

std::optional<double> Retry::PauseAfter(int tried) {
  const int rounds_before = losses_ / servers_;
  losses_ += tried;
  const int rounds = losses_ / servers_;
  if (rounds == rounds_before) return 0;
  const double left_s = retry_for_s_ - clock_.SecondsSince(since_);
  if (left_s < kMinLeftS) return std::nullopt;
  // The jitter keeps a thousand clients from coming back in the same instant.
  const double pause_s = std::min(kMaxPauseS, kFirstPauseS * std::exp2(std::min(rounds - 1, 10)));
  return std::min(left_s, pause_s * std::uniform_real_distribution<double>(kMinPauseShare, 1)(jitter_));
}

}  // namespace touchstone::client
