// Sensor: time of contact -> reported time = tick((time + noise) * clock).
#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/touch/gauss_markov.h"
#include "server/touch/simulate.h"

namespace touchstone::touch {
namespace {

// Student's t by Bailey's polar form: sqrt(nu (u^(-2/nu) - 1)) cos(2 pi v) for uniform u in (0, 1] and v.
// R. W. Bailey, "Polar generation of random variates with the t-distribution", Math. Comp. 62, 1994.
double StudentT(RandomStream* random, double degrees_of_freedom) {
  const double u = 1 - random->Uniform();
  const double v = random->Uniform();
  return std::sqrt(degrees_of_freedom * std::expm1(-2 / degrees_of_freedom * std::log(u))) *
         std::cos(2 * kPi * v);
}

void AddNoise(effects::TouchBatch* batch, TouchWorkspace* workspace) {
  const int size = batch->size(), fingers = batch->fingers();
  workspace->normals.resize(static_cast<size_t>(size) * fingers);
  double* deviates = workspace->normals.data();  // [touch][finger]
  if (batch->degrees_of_freedom > 0) {
    for (int touch = 0; touch < size; ++touch) {
      RandomStream random(batch->seed, RandomDomain::kTouchNoise, batch->index[touch]);
      for (int finger = 0; finger < fingers; ++finger)
        deviates[touch * fingers + finger] = StudentT(&random, batch->degrees_of_freedom);
    }
  } else {
    FillNormals(batch->seed, RandomDomain::kTouchNoise, batch->index.data(), size, fingers, deviates);
  }
  for (int finger = 0; finger < fingers; ++finger) {
    const int begin = batch->At(finger, 0);
    if (!batch->noise_growth.empty())
      for (int touch = 0; touch < size; ++touch)
        batch->noise_sigma_s[begin + touch] *= batch->noise_growth[begin + touch];
    for (int touch = 0; touch < size; ++touch)
      batch->reported_time_s[begin + touch] +=
          batch->noise_sigma_s[begin + touch] * deviates[touch * fingers + finger];
  }
}

// Noise with memory: where in the session a touch is made decides, not its number.
void AddCorrelatedNoise(effects::TouchBatch* batch) {
  for (int finger = 0; finger < batch->fingers(); ++finger)
    for (int touch = 0; touch < batch->size(); ++touch)
      batch->reported_time_s[batch->At(finger, touch)] +=
          batch->wander_sigma_s *
          GaussMarkov(batch->seed, finger,
                      std::max(batch->session_time_s[touch], 0.0) / batch->wander_time_s);
}

}  // namespace

void ReportTimes(effects::TouchBatch* batch, TouchWorkspace* workspace) {
  if (batch->any_noise) AddNoise(batch, workspace);
  if (batch->wander_sigma_s > 0) AddCorrelatedNoise(batch);
  if (batch->clock_factor != 1)
    for (double& time_s : batch->reported_time_s) time_s *= batch->clock_factor;
  if (batch->poll_interval_s > 0) {
    // Up to the next tick; a touch's loop has a phase of its own, the same for all of its fingers.
    const double interval_s = batch->poll_interval_s;
    for (int touch = 0; touch < batch->size(); ++touch) {
      const double phase_s =
          interval_s * RandomStream(batch->seed, RandomDomain::kPollPhase, batch->index[touch]).Uniform();
      for (int finger = 0; finger < batch->fingers(); ++finger) {
        double& time_s = batch->reported_time_s[batch->At(finger, touch)];
        time_s = std::ceil((time_s - phase_s) / interval_s) * interval_s + phase_s;
      }
    }
  }
  if (batch->missed_probability > 0) {
    for (int touch = 0; touch < batch->size(); ++touch) {
      RandomStream random(batch->seed, RandomDomain::kMissedContact, batch->index[touch]);
      for (int finger = 0; finger < batch->fingers(); ++finger)
        if (random.Uniform() < batch->missed_probability)
          batch->reported_time_s[batch->At(finger, touch)] = NAN;
    }
  }
}

}  // namespace touchstone::touch
