#include "server/effects/touch_batch.h"

#include "server/base/check.h"

namespace touchstone::effects {

void TouchBatch::Reset(int size, int fingers) {
  TOUCHSTONE_CHECK(size >= 0 && fingers >= 1);
  size_ = size;
  fingers_ = fingers;
  const size_t touches = size;
  const size_t entries = touches * fingers;

  // The commanded touches.
  index.resize(touches);
  target_m.resize(touches);
  approach.resize(touches);
  lateral.resize(touches);
  standoff_m.resize(touches);
  speed_m_s.resize(touches);
  session_time_s.assign(touches, 0.0);
  pause_s.assign(touches, 0.0);
  previous_press_m.assign(entries, 0.0);
  covariates.clear();

  // Pose.
  travel_offset_m.assign(entries, 0.0);
  tip_displacement_m.setZero();
  surface_scale = 1;
  surface_rotation.setIdentity();
  surface_translation_m.setZero();

  // Contact.
  tip_radius_m = 0;
  travel_m.resize(entries);
  normal.resize(entries);
  contact_m.resize(entries);
  cos_incidence.resize(entries);
  curvature_per_m.assign(entries, 0.0);

  // Motion.
  speed_factor = 1;
  acceleration_m_s2 = 0;
  slowdown_fraction = 0;
  first_finger.assign(touches, -1);
  contact_time_s.resize(entries);
  time_per_travel_s_m.resize(entries);
  press_m.resize(entries);

  // Sensor.
  reported_time_s.resize(entries);
  noise_sigma_s.assign(entries, 0.0);
  noise_growth.clear();
  any_noise = false;
  degrees_of_freedom = 0;
  clock_factor = 1;
  poll_interval_s = 0;
  missed_probability = 0;
  wander_sigma_s = wander_time_s = 0;
  formula_error.clear();
}

}  // namespace touchstone::effects
