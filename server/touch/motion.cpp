// Motion: travel -> time of contact.
//   t(d) = d / v                        at full speed from the start
//   t(d) = sqrt(2 d / a)                with a ramp from rest at acceleration a, while d < v^2 / (2 a),
//          v / (2 a) + d / v            then
//   t1 + (t(d) - t1) / (1 - slowdown)   after the first contact, at time t1
#include <algorithm>
#include <cmath>

#include "server/touch/simulate.h"

namespace touchstone::touch {

void FindFirstFingers(effects::TouchBatch* batch) {
  // Ties go to the lower finger. Comparisons with NaN are false, so a finger without contact is never first.
  for (int touch = 0; touch < batch->size(); ++touch) {
    int first = -1;
    double min_m = INFINITY;
    for (int finger = 0; finger < batch->fingers(); ++finger) {
      const double travel_m = batch->travel_m[batch->At(finger, touch)];
      if (travel_m < min_m) first = finger, min_m = travel_m;
    }
    batch->first_finger[touch] = first;
  }
}

void TravelToTime(effects::TouchBatch* batch) {
  const double acceleration = batch->acceleration_m_s2;
  if (!(acceleration > 0)) {
    const double factor = batch->speed_factor;
    for (int finger = 0; finger < batch->fingers(); ++finger) {
      const double* const speeds_m_s = batch->speed_m_s.data();
      const double* const travels_m = batch->travel_m.data() + batch->At(finger, 0);
      double* const times_s = batch->contact_time_s.data() + batch->At(finger, 0);
      double* const slopes_s_m = batch->time_per_travel_s_m.data() + batch->At(finger, 0);
      for (int touch = 0; touch < batch->size(); ++touch) {
        const double speed_m_s = speeds_m_s[touch] * factor;
        times_s[touch] = travels_m[touch] / speed_m_s;
        slopes_s_m[touch] = 1 / speed_m_s;
      }
    }
  }
  for (int finger = 0; acceleration > 0 && finger < batch->fingers(); ++finger) {
    const int begin = batch->At(finger, 0);
    for (int touch = 0; touch < batch->size(); ++touch) {
      const double speed_m_s = batch->speed_m_s[touch] * batch->speed_factor;
      const double travel_m = batch->travel_m[begin + touch];
      double time_s = travel_m / speed_m_s;
      double inverse_speed_s_per_m = 1 / speed_m_s;
      if (travel_m > 0) {
        const double ramp_m = speed_m_s * speed_m_s / (2 * acceleration);
        if (travel_m < ramp_m) {
          time_s = std::sqrt(2 * travel_m / acceleration);
          inverse_speed_s_per_m = 1 / std::sqrt(2 * travel_m * acceleration);
        } else {
          time_s += speed_m_s / (2 * acceleration);
        }
      }
      batch->contact_time_s[begin + touch] = time_s;
      batch->time_per_travel_s_m[begin + touch] = inverse_speed_s_per_m;
    }
  }

  // The slowdown stretches what comes after the first contact.
  if (batch->slowdown_fraction > 0) {
    const double stretch = 1 / (1 - batch->slowdown_fraction);
    for (int touch = 0; touch < batch->size(); ++touch) {
      const int first = batch->first_finger[touch];
      if (first < 0) continue;
      const double first_time_s = batch->contact_time_s[batch->At(first, touch)];
      for (int finger = 0; finger < batch->fingers(); ++finger) {
        if (finger == first) continue;
        const int k = batch->At(finger, touch);
        batch->contact_time_s[k] = first_time_s + (batch->contact_time_s[k] - first_time_s) * stretch;
        batch->time_per_travel_s_m[k] *= stretch;
      }
    }
  }

  // How far each finger is pressed in when the last one touches. Finger by finger, so that it vectorises.
  const int size = batch->size();
  double* const presses_m = batch->press_m.data();
  const double* const times_s = batch->contact_time_s.data();
  const double* const speeds_m_s = batch->speed_m_s.data();
  constexpr int kTile = 256;
  double last_s[kTile];
  for (int begin = 0; begin < size; begin += kTile) {
    const int n = std::min(kTile, size - begin);
    std::fill(last_s, last_s + n, -INFINITY);
    for (int finger = 0; finger < batch->fingers(); ++finger) {
      const double* const own_s = times_s + batch->At(finger, begin);
      for (int k = 0; k < n; ++k)
        last_s[k] = last_s[k] < own_s[k] ? own_s[k] : last_s[k];  // NaN is never last
    }
    for (int finger = 0; finger < batch->fingers(); ++finger) {
      const double* const own_s = times_s + batch->At(finger, begin);
      double* const own_press_m = presses_m + batch->At(finger, begin);
      for (int k = 0; k < n; ++k) {
        const double press_m = (last_s[k] - own_s[k]) * speeds_m_s[begin + k];
        own_press_m[k] = press_m == press_m ? press_m : 0;
      }
    }
  }
}

}  // namespace touchstone::touch
