// The rig with all hidden effects, touch by touch, without noise: pose, contact, motion, and the part of the sensor
// that is not random. Millimetres, seconds.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/hidden_effects/generator/bumps.h"
#include "tests/hidden_effects/generator/generate.h"

namespace touchstone::hidden {

// Independent random numbers for each purpose.
std::mt19937_64 Stream(uint64_t seed, const char* purpose);

class Rig {
 public:
  // `seed` draws the bumps, and how objects and poses stand rotated.
  Rig(const Scenario& scenario, uint64_t seed);

  struct Finger {
    bool hit = false;
    double time_s = 0;      // of the contact, since the start
    double reported_s = 0;  // with latency, slip, drift, hysteresis; before noise and the clock
    double tan_incidence = 0;
  };

  // The session's next touch. Touches must come in the order of the session, since fingers keep the indentation of the last one.
  std::vector<Finger> Touch(const Command& command, double speed_mm_s, double session_time_s,
                            double temperature);

  // Corrects the indentation of each finger by the last touch, mm, where that was not the whole approach that Touch
  // assumed.
  void Remember(std::vector<double> pressed_mm) { pressed_mm_ = std::move(pressed_mm); }

  double clock_factor() const { return 1 + Value("clock_skew"); }
  // A value of a hidden effect; `neutral` if it is not there.
  double Value(const std::string& effect, int index = 0, double neutral = 0) const;

 private:
  // Where each finger touches: what the rounds of a pose have in common.
  struct Landing {
    bool hit;
    double travel_mm, cosine, tangent;
    Eigen::Vector3d contact_mm;
  };
  std::vector<Landing> Land(const Command& command) const;
  // Of a pose that was met before, remembered.
  std::vector<Landing> Landed(const Command& command);
  // What the physics that no catalogue lists adds to each finger's travel, mm.
  std::vector<double> AddedTravelMm(const std::vector<Landing>& landings, int first, const Command& command,
                                    double session_time_s, double temperature) const;
  const Cause* Find(CauseKind kind) const;

  // By pose, and by round where objects are put down anew.
  std::map<std::pair<int, int>, std::vector<Landing>> landed_;

  Scenario scenario_;
  uint64_t seed_;
  std::map<std::string, std::vector<double>> values_;
  std::vector<Bumps> bumps_;        // one per object
  std::vector<double> pressed_mm_;  // by the previous touch, per finger
};

}  // namespace touchstone::hidden
