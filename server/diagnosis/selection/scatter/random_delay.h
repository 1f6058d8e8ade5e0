// Whether readings come late by a random delay beside normal noise: one of two values, any up to a largest, or exponentially
// distributed. Such noise is neither normal nor has it the tails of Student's t; a contact that bounces, a channel that retries
// and a loop that polls at times of its own make it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/selection/scatter/delay_likelihood.h"
#include "server/diagnosis/touches/noise/noise_kinds.h"

namespace touchstone::diagnosis::selection {

struct RandomDelay {
  DelayedNoise noise;
  touches::NoiseEstimate sigma_s;  // of the normal noise beside it
  double length_m = 0;             // of a delay of the travel
  bool plain_noise = false;        // that noise has one scale, whatever kinds were found without the delays
  bool ahead = false;    // of noise without delays; false: the two explain the scatter about as well
  double gain_nats = 0;  // over the best noise without delays
  std::string words;     // sentences for people
};

// `sample`: of the residuals of the best model; `noise`: found in the same residuals; `fingers`: of the end effector. Nothing
// where noise without delays says more, fewer than three fingers report, or too few readings are late, or in time.
std::optional<RandomDelay> FindRandomDelay(const touches::NoiseSample& sample,
                                           const touches::NoiseFindings& noise, int fingers);

// What the noise is beside the delays: of the kinds found without them, those that they have made go.
touches::NoiseFindings WithoutDelays(const RandomDelay& delay, touches::NoiseFindings noise);

}  // namespace touchstone::diagnosis::selection
