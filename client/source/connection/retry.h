// What a client does when a server is lost, says nothing, or is full: for every call, before a stream and in it. Its twin is
// client/python/touchstone/retry.py; client/python/tests/test_retry.py compares both, and the table in server/LIMITS.md.
#pragma once

#include <optional>
#include <random>

#include "server/base/threads/clock.h"

namespace touchstone::client {

inline constexpr double kConnectS = 4;    // that a server has to answer a new connection
inline constexpr double kKeepaliveS = 2;  // silence during a call after which it is asked for a sign of life
inline constexpr double kKeepaliveTimeoutS = 6;  // that it has to give one; idle channels look every 5 s
inline constexpr double kFirstPauseS = 0.1;      // after the first round of all servers; then twice as long
inline constexpr double kMaxPauseS = 3;
inline constexpr double kMinPauseShare = 0.5;  // a pause is drawn from so much of it to the whole
inline constexpr double kRetryForS = 60;       // since the last thing that arrived

// Counts losses: the next server is tried at once, and after each round of all servers there is a pause.
class Retry {
 public:
  Retry(int servers, double retry_for_s, const Clock& clock);

  // After `tried` more servers failed: for how long to wait before the next one, in seconds; nothing once the time is over,
  // which is looked at after a whole round only.
  std::optional<double> PauseAfter(int tried);

 private:
  const int servers_;
  const double retry_for_s_;
  const Clock& clock_;
  const Clock::Time since_;
  int losses_ = 0;
  std::minstd_rand jitter_{std::random_device{}()};
};

}  // namespace touchstone::client
