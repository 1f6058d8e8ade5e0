// Files for the tests of this folder: a rig with physics that the model lacks, and mistakes made in its file.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/checks/data_problems.h"
#include "server/diagnosis/touches/simulated_test_set.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::diagnosis::checks {

using session::MeasurementFix;
using session::MeasurementSet;

// Times as files have them: since the first finger's.
inline DiagnosisInput MakeFile(const touches::HiddenRig& rig) {
  DiagnosisInput input = MakeTestInput(rig);
  auto set = std::make_shared<MeasurementSet>(*input.set);
  for (int row = 0; row < set->size(); ++row) {
    double* times_s = &set->time_s[row * 3];
    double first_s = INFINITY;
    for (int i = 0; i < 3; ++i)
      if (times_s[i] < first_s) first_s = times_s[i];
    for (int i = 0; i < 3; ++i) times_s[i] -= first_s;
  }
  input.set = set;
  return input;
}

// A rig with physics that the model lacks: it must neither hide a mistake nor be one.
inline touches::HiddenRig Rig(uint64_t seed = 1) {
  touches::HiddenRig rig;
  // The shapes look the same from several sides; an object that stands rotated, as the model knows, does not.
  rig.known = {{"object_pose", {"translation_mm=4,-3,2", "rotation_deg=20,-15,25"}}};
  rig.hidden = rig.known;
  rig.hidden.push_back({"tip_radius", {"radius_mm=0.5"}});
  rig.hidden.push_back({"object_push", {"shift_mm=0.2"}});
  rig.rounds = 2;
  rig.sigma_us = 5000;
  rig.seed = seed;
  return rig;
}

inline DiagnosisInput Corrupted(DiagnosisInput input, const std::function<void(MeasurementSet*)>& corrupt) {
  auto set = std::make_shared<MeasurementSet>(*input.set);
  corrupt(set.get());
  input.set = set;
  return input;
}

inline DiagnosisInput Corrupted(const DiagnosisInput& input, const MeasurementFix& fix) {
  return Corrupted(input, [&](MeasurementSet* set) { ASSERT_TRUE(session::ApplyFix(fix, set).ok()); });
}

inline std::vector<engine::DataProblem> ProblemsOf(const DiagnosisInput& input) {
  const auto problems = FindDataProblems(input, {});
  EXPECT_TRUE(problems.ok()) << problems.status();
  return problems.ok() ? *problems : std::vector<engine::DataProblem>();
}

// A fix, set field by field.
inline MeasurementFix With(const std::function<void(MeasurementFix*)>& set) {
  MeasurementFix fix;
  set(&fix);
  return fix;
}

}  // namespace touchstone::diagnosis::checks
