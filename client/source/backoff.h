// How long a client pauses before it asks a source again that did not answer.
#pragma once

#include <algorithm>

namespace touchstone::client {

inline constexpr double kFirstBackoffS = 0.1;

// The pause after one of `backoff_s`: twice as long, up to 3 s.
inline double NextBackoffS(double backoff_s) {
  constexpr double kLongestBackoffS = 3;
  return std::min(2 * backoff_s, kLongestBackoffS);
}

}  // namespace touchstone::client
