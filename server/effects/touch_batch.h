// What effects act on: a batch of touches of one object by one rig, as arrays.
//
// Arrays "per touch" have size() entries. Arrays "per finger" have size() * fingers entries, finger-major: entry
// At(finger, touch) = finger * size() + touch, so that a loop over the touches of one finger runs through memory in
// order. SI units, object frame. The stages pose, contact, motion and sensor run in the order of the fields below; a
// stage reads the fields above its own and changes its own only.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace touchstone::geometry {
class Surface;
}

namespace touchstone::effects {

class TouchBatch {
 public:
  // Makes room. Fields that effects change and what is given get their neutral value (zero offsets and noise,
  // no formula error, `lateral` and `approach` unset); arrays that a stage fills whole (travel_m, normal,
  // contact_m, cos_incidence, contact_time_s, time_per_travel_s_m, press_m, reported_time_s) are only sized.
  // The surface, seed, spacing and stroke stay. Capacity is kept between calls.
  void Reset(int size, int fingers);

  int size() const { return size_; }
  int fingers() const { return fingers_; }
  int At(int finger, int touch) const { return finger * size_ + touch; }

  // Where the finger stands along the lateral vector, in units of the spacing: i - (n-1)/2.
  double FingerPosition(int finger) const { return finger - 0.5 * (fingers_ - 1); }

  // --- Given: the commanded touches ---
  std::shared_ptr<const geometry::Surface> surface;  // the nominal mesh
  uint64_t seed = 0;                                 // of the dataset or session
  std::vector<uint64_t> index;                       // per touch: its number in the dataset or session
  std::vector<Eigen::Vector3d> target_m;             // per touch: T
  std::vector<Eigen::Vector3d> approach;             // per touch: unit vector a
  std::vector<Eigen::Vector3d>
      lateral;                         // per touch: unit vector s; the pose stage turns it into the real one
  std::vector<double> standoff_m;      // per touch
  std::vector<double> speed_m_s;       // per touch: commanded
  std::vector<double> session_time_s;  // per touch
  std::vector<double> pause_s;         // per touch: since the session's previous touch; 0 for the first
  // Per finger: how far the previous touch of the session pressed it in after its contact; 0 for the first touch.
  std::vector<double> previous_press_m;
  std::map<std::string, std::vector<double>> covariates;  // per touch, by name ("cov_temperature")
  double spacing_m = 0.030;  // the pose stage turns the nominal into the real one
  double stroke_m = 1e3;     // the approach ends after this travel; 1 km: no limit

  // --- Pose: the real lines relative to the real surface ---
  std::vector<double> travel_offset_m;  // per finger: added to the travel until contact
  Eigen::Vector3d tip_displacement_m = Eigen::Vector3d::Zero();  // of every finger tip, object frame
  double surface_scale = 1;  // surface = translation + rotation * (scale * mesh)
  Eigen::Matrix3d surface_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d surface_translation_m = Eigen::Vector3d::Zero();

  // --- Contact ---
  double tip_radius_m = 0;                 // set before the cast by contact effects
  std::vector<double> travel_m;            // per finger: until contact, offsets included; NaN: no contact
  std::vector<Eigen::Vector3d> normal;     // per finger: unit, outward, at the contact
  std::vector<Eigen::Vector3d> contact_m;  // per finger: the point on the real surface, object frame
  std::vector<double> cos_incidence;       // per finger: approach . inward normal, in [0, 1]
  std::vector<double> curvature_per_m;  // per finger: mean curvature of the surface, filled only when needed

  // --- Motion ---
  // Effects change these three (and travel_m); the stage then turns travel into time (touch/motion.cpp).
  double speed_factor = 1;             // real over commanded speed
  double acceleration_m_s2 = 0;        // of the ramp from rest; 0: at full speed from the start
  double slowdown_fraction = 0;        // from the first contact on, the speed is (1 - fraction) of itself
  std::vector<int> first_finger;       // per touch: which finger touched first; -1: none
  std::vector<double> contact_time_s;  // per finger: true time of contact since the start; NaN: none
  std::vector<double> time_per_travel_s_m;  // per finger: slope of time over travel at its contact
  std::vector<double> press_m;              // per finger: (last contact time - own) * commanded speed

  // --- Sensor ---
  // Effects change these; the stage then makes reported = ceil_to_tick((time + noise) * clock_factor).
  std::vector<double> reported_time_s;  // per finger: starts as contact_time_s, effects shift it
  // The noise of a finger has the scale noise_sigma_s * noise_growth, whatever the order of the effects.
  std::vector<double> noise_sigma_s;  // per finger: standard deviation (scale) of the noise
  std::vector<double> noise_growth;   // per finger: factor on noise_sigma_s; empty: 1 everywhere
  bool any_noise = false;             // set by the effects that fill noise_sigma_s
  double degrees_of_freedom = 0;      // of Student's t; 0: Gaussian
  double clock_factor = 1;            // reported over true time
  double poll_interval_s = 0;         // 0: no polling
  double missed_probability = 0;      // per finger and touch
  double wander_sigma_s = 0;          // noise with memory: standard deviation of a finger's,
  double wander_time_s = 0;           // and its correlation time

  // The first formula whose value was not finite, with the touch and the inputs; empty: none. A stage that finds it
  // set after its effects fails the whole batch with this text (INVALID_ARGUMENT).
  std::string formula_error;

 private:
  int size_ = 0;
  int fingers_ = 0;
};

}  // namespace touchstone::effects
