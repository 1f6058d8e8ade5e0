// So many of something a second; what was not used in the last seconds is saved up. Not for several threads.
#pragma once

#include <algorithm>
#include <chrono>

#include "server/base/threads/clock.h"

namespace touchstone::service {

class TokenBucket {
 public:
  // What was not used in the last `saved_s` is there.
  TokenBucket(double per_s, double saved_s, Clock::Time now)
      : per_s_(per_s), max_(per_s * saved_s), tokens_(max_), at_(now) {}

  // False: there is none to take.
  bool Take(Clock::Time now) {
    Fill(now);
    if (tokens_ < 1) return false;
    tokens_ -= 1;
    return true;
  }
  // Taken without asking: what comes later waits until it is made up for.
  void Charge() { tokens_ -= 1; }
  bool in_debt() const { return tokens_ < 0; }  // as of the last time
  void Fill(Clock::Time now) {
    tokens_ = Tokens(now);
    at_ = std::max(at_, now);
  }
  bool full(Clock::Time now) const { return Tokens(now) >= max_; }

 private:
  double Tokens(Clock::Time now) const {
    const double s = std::chrono::duration<double>(now - at_).count();
    return std::min(max_, tokens_ + per_s_ * std::max(s, 0.0));
  }

  double per_s_, max_, tokens_;
  Clock::Time at_;
};

}  // namespace touchstone::service
