// For tests: the first sets of an arm, with tuning seeds, all answered as wanted.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/base/test_paths.h"
#include "tests/hidden_effects/score/trial.h"

namespace touchstone::hidden {

inline const TestObjects& SharedTestObjects() {
  static const auto* objects = new TestObjects(LoadTestObjects(SharedData() + "/measurements"));
  return *objects;
}

// Runs the first `sets` sets of an arm; every answer to `measure` must be `wanted`, but for `exceptions`.
inline void ExpectAlways(const char* arm_name, int sets, const char* measure, bool wanted,
                         int exceptions = 0) {
  const Arm* arm = FindArm(arm_name);
  ASSERT_NE(arm, nullptr);
  int asked = 0, otherwise = 0;
  std::string wrong;
  for (int k = 0; k < sets; ++k) {
    const Outcome outcome = RunOne(*arm, SeedOf(Seeds::kTuning, *arm, k), SharedTestObjects(), false);
    ASSERT_EQ(outcome.error, "");
    std::vector<Mark> marks = outcome.marks;
    marks.insert(marks.end(), outcome.figures.begin(), outcome.figures.end());
    for (const Mark& mark : marks) {
      if (mark.measure != measure) continue;
      ++asked;
      if (mark.yes == wanted) continue;
      ++otherwise;
      wrong += "\n  hidden " + TruthInWords(outcome.set.truth) + "\n  said " + ReportInWords(outcome.report);
    }
  }
  EXPECT_GT(asked, 0);
  EXPECT_LE(otherwise, exceptions) << wrong;
}

}  // namespace touchstone::hidden
