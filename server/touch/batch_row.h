// The one way from a commanded touch to a row of a batch, and from reported times to the descriptor.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "server/effects/touch_batch.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::touch {

// Fills row `row` of a batch that TouchSimulator::Prepare has sized. `index` decides the touch's random numbers.
inline void SetTouch(const TouchPose& pose, double speed_m_s, double session_time_s, uint64_t index, int row,
                     effects::TouchBatch* batch) {
  batch->index[row] = index;
  batch->target_m[row] = pose.target_m;
  batch->approach[row] = pose.approach;
  batch->lateral[row] = pose.lateral;
  batch->standoff_m[row] = pose.standoff_m;
  batch->speed_m_s[row] = speed_m_s;
  batch->session_time_s[row] = session_time_s;
}

// Between a touch and the session's previous one; 0 where the session begins anew.
inline double PauseBetween(double previous_s, double session_time_s) {
  return session_time_s > previous_s ? session_time_s - previous_s : 0;
}

// The stroke and the covariates are the batch's: see below.
inline void SetTouch(const CommandedTouch& touch, uint64_t index, int row, effects::TouchBatch* batch) {
  SetTouch(touch, touch.speed_m_s, touch.session_time_s, index, row, batch);
}

// The named covariates of the touch in its row. INVALID_ARGUMENT names `where` ("touches[3]") and the covariate
// that the touch lacks.
absl::Status SetCovariates(const std::vector<std::string>& names, const CommandedTouch& touch,
                           const std::string& where, int row, effects::TouchBatch* batch);

// The descriptor: contact times relative to the first reporting finger's. Finger i's time is times_s[i * stride]
// (seconds), NaN where it reported nothing, and so is its entry then. Calls put(finger, relative_s); returns
// whether every finger reported.
template <typename Put>
bool ForDescriptor(const double* times_s, size_t stride, int fingers, Put put) {
  double first_s = INFINITY;
  bool complete = true;
  for (int finger = 0; finger < fingers; ++finger) {
    const double time_s = times_s[finger * stride];
    first_s = time_s < first_s ? time_s : first_s;
    complete &= !std::isnan(time_s);
  }
  for (int finger = 0; finger < fingers; ++finger) put(finger, times_s[finger * stride] - first_s);
  return complete;
}

}  // namespace touchstone::touch
