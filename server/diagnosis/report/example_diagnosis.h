// A diagnosis as the tests of this room start from it: 960 touches of two objects, 41 ms off over 5 ms of noise.
#pragma once

#include <cmath>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

inline engine::ParameterEstimate RadiusMm() {
  engine::ParameterEstimate radius;
  radius.name = "radius_mm";
  radius.value = 2.98;
  radius.std_error = 0.02;
  radius.unit = "mm";
  radius.lower = 2.94;
  radius.upper = 3.02;
  return radius;
}

inline engine::LadderStep Step(const std::string& effect) {
  engine::LadderStep step;
  step.effect = effect;
  step.probability = 0.98;
  step.gain_nats = 1200;
  step.parameters = {RadiusMm()};
  step.quality = {0.005, 0.00503, 0.4};
  step.meaning = "What it is.";
  step.check_on_rig = "Measure the tips.";
  step.remedy = "Keep the radius.";
  return step;
}

inline Diagnosis ExampleDiagnosis(engine::Verdict verdict) {
  Diagnosis diagnosis;
  diagnosis.verdict = verdict;
  diagnosis.model_name = "nominal";
  diagnosis.model_hash = "354f";
  diagnosis.data.origin = "set.csv";
  diagnosis.data.fingers = 3;
  diagnosis.data.rows = 962;
  diagnosis.data.unused["at an edge"] = {2, {17, 45}};
  diagnosis.data.objects = {"lat00", "lat20"};
  diagnosis.data.touches = 960;
  diagnosis.data.poses = 240;
  diagnosis.data.repeats = 720;
  diagnosis.data.rounds = 4;
  diagnosis.data.speeds_mm_s = {20};
  diagnosis.data.missed_contacts = 3;
  diagnosis.noise_floor.emplace();
  diagnosis.noise_floor->sigma = 0.005;
  diagnosis.noise_floor->lower = 0.0048;
  diagnosis.noise_floor->upper = 0.0052;
  diagnosis.noise_floor->degrees_of_freedom = 1440;
  diagnosis.noise_floor->from_repeats = true;
  diagnosis.initial = {0.041, 0.0411, 1e-20};
  diagnosis.final = {0.005, 0.00503, 0.4};
  diagnosis.reducible_share = 0.985;
  return diagnosis;
}

}  // namespace touchstone::diagnosis::report
