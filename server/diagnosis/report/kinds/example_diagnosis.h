// A diagnosis as the tests of this room start from it: 960 touches of two objects, 41 ms off over 5 ms of noise.
#pragma once

#include <cmath>

#include "server/diagnosis/report/kinds/from_touches.h"

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

inline Step ExampleStep(const std::string& effect) {
  Step step;
  step.effect = effect;
  step.probability = 0.98;
  step.gain_nats = 1200;
  step.parameters = {RadiusMm()};
  step.meaning = "What it is.";
  step.check_on_rig = "Measure the tips.";
  step.remedy = "Keep the radius.";
  return step;
}

inline Diagnosis ExampleDiagnosis(engine::Verdict verdict) {
  touches::DataSummary set;
  set.origin = "set.csv";
  set.fingers = 3;
  set.rows = 962;
  set.unused["at an edge"] = {2, {17, 45}};
  set.objects = {"lat00", "lat20"};
  set.touches = 960;
  set.poses = 240;
  set.repeats = 720;
  set.rounds = 4;
  set.speeds_mm_s = {20};
  set.missed_contacts = 3;
  Diagnosis diagnosis;
  diagnosis.verdict = verdict;
  diagnosis.model_name = "nominal";
  diagnosis.model_hash = "354f";
  diagnosis.data = {DataOfTouches(set)};
  DataReport& data = diagnosis.data[0];
  data.noise_floor.emplace();
  data.noise_floor->sigma = 5000;
  data.noise_floor->lower = 4800;
  data.noise_floor->upper = 5200;
  data.noise_floor->degrees_of_freedom = 1440;
  data.noise_floor->from_repeats = true;
  data.initial = Quality{41000, 41100, 1e-20};
  data.final = Quality{5000, 5030, 0.4};
  data.reducible_share = 0.985;
  return diagnosis;
}

}  // namespace touchstone::diagnosis::report
