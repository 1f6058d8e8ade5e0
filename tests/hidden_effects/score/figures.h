// The three figures that every arm has: right, honest, confidently wrong; and whether what is claimed with near certainty
// is so.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "tests/hidden_effects/score/answers.h"
#include "tests/hidden_effects/score/judge.h"

namespace touchstone::hidden {

// What was tried beside reading the report (verify.h). NaN: there was nothing to try.
struct Tried {
  double final_found_us = NAN;   // by Compare with the saved model; infinite: it could not be compared
  double formula_cuts_to = NAN;  // of the mean square misfit on fresh touches, as a share
  double lookup_cuts_to = NAN;
  double fresh_us = NAN;  // as final_found_us, on fresh touches
};

// Measures "right", "honest", "confidently wrong"; "error on fresh touches as claimed" and "fall not found again" where a fall is claimed; "claim beyond 0.99 right" once for each such claim; "probability of
// 1" for each step; "unexplained by time" and "lookup halves the misfit" where that is wanted. `marks`: what Judge says about the same report.
std::vector<Mark> JudgeFigures(const Arm& arm, const Scenario& truth, const v1::Report& report,
                               const std::vector<Mark>& marks, const Tried& tried);

// Whether a fall of the error is claimed that is not found again within 5 %.
bool FallIsNotFound(const v1::Report& report, double final_found_us);
// What the report says that unseen touches leave; the error of those that were seen where it does not say.
double ClaimedErrorUs(const v1::Report& report);
// Whether a fall of the error is claimed at all.
bool ClaimsAFall(const v1::Report& report);
// Whether the cause is a curve of one covariate, with values for each finger, that fresh touches follow too.
bool IsACurve(const Arm& arm, const Scenario& truth);

}  // namespace touchstone::hidden
