// Noise with memory: how much of what a model leaves is a Gauss-Markov process (AR(1)) of each finger in session time, beside
// noise without memory. Maximum likelihood by a Kalman filter over the touches in the order of the session.
#pragma once

#include <optional>
#include <vector>

#include "server/diagnosis/touches/noise/noise_kinds.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

struct NoiseMemory {
  touches::NoiseEstimate sigma_s;                       // of the correlated noise
  touches::NoiseEstimate time_s;                        // its correlation time
  touches::NoiseEstimate white_s;                       // of the noise without memory beside it
  double log_likelihood = 0, white_log_likelihood = 0;  // with it; of noise without memory alone
  double complexity_nats = 0;                           // of its two values (BIC)
  // By how much noise that reverts to its mean fits better than a random walk, which never does. Near 0 the session is too short to tell
  // when, if ever, the course comes back: that is a course in time and not noise of a known memory.
  double forgets_nats = 0;
  bool everywhere = false;    // it shows in three of four quarters of the session: it is no event
  double gain_nats = 0;       // log evidence over noise without memory (BIC)
  double step_gain_nats = 0;  // the same of one step of the fingers at the best moment, and none of it
  // The same of a course without corners, a Matern process of order 3/2: a period or a warm-up is one, this is not.
  double smooth_gain_nats = 0;
  // The same of a course that repeats, of any shape: a mean for each of twelve parts of the best period; noise does not.
  double period_gain_nats = 0;
};

// `residuals` [k * fingers + i]. Nothing without session times or with too few complete touches.
std::optional<NoiseMemory> FindNoiseMemory(const touches::Observations& observations,
                                           const std::vector<double>& residuals);

// Whether the data say that it reverts to its mean within the session.
bool RevertsToMean(const NoiseMemory& memory);

// What the residuals say of correlated noise that a model has.
struct DeclaredMemory {
  bool absent = false;  // none of it fits the residuals better by 5 nats
  bool other = false;   // another size or time does
};

// Neither where the set could not show it (few touches, no session times, a memory longer than half the session).
DeclaredMemory AssessDeclaredMemory(const touches::Observations& observations,
                                    const std::vector<double>& residuals, double sigma_s, double time_s);

}  // namespace touchstone::diagnosis::selection
