// What is measured, and what is hidden in it. Numbers are in the units of files (mm, us, deg).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/hidden_effects/generator/causes.h"
#include "tests/hidden_effects/generator/data_errors.h"
#include "tests/hidden_effects/generator/solid.h"

namespace touchstone::hidden {

// One hidden effect. `values` are those of the catalogue, flat, in the order of its parameters there; object_pose has its six
// numbers once per object, surface_error (rms_mm, length_mm) draws one field per object.
struct Hidden {
  std::string effect;
  std::vector<double> values;
};

// Physics that the catalogue does not list, defined in unlisted.cpp. `second` is a lead or the like.
struct Unlisted {
  std::string name;
  double k_mm = 0;
  double second = 0;
};

struct Scenario {
  std::vector<std::shared_ptr<const Solid>> objects;
  int fingers = 3;
  double spacing_mm = 30;
  double standoff_mm = 60;
  int poses = 48;  // per object, over its six faces
  int rounds = 4;
  std::vector<double> speeds_mm_s = {20};
  bool speed_by_round = false;  // else by pose
  double sigma_us = 5000;
  std::vector<Hidden> hidden;
  std::vector<Unlisted> unlisted;
  std::vector<Cause> causes;
  std::vector<DataError> data_errors;  // mistakes in the file, in this order
  std::vector<Hidden> in_model;        // what the nominal model file has besides the noise
  bool noise_in_model = true;          // whether the nominal model file has gaussian_noise
  double model_sigma_us = 0;           // what the nominal model claims; 0: sigma_us
  double outlier_share = 0;            // of the fingers' times,
  double outlier_us = 100'000;         // off by up to this much
  double missing_share = 0;            // of the fingers' times
  bool with_poses = true;              // false: only objects and times are written
  bool with_temperature = false;       // a column cov_temperature
};

// The order of the catalogue's numbers: a scalar has 1, a vector 3, a parameter per finger `fingers`.
int ValueCount(const std::string& effect, int fingers);

// Whether the effect changes times, not only their scatter.
bool IsNoise(const std::string& effect);

}  // namespace touchstone::hidden
