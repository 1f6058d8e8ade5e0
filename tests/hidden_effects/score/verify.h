// What a report claims, tried again: the final error by Compare with the saved model, what is suggested on
// fresh touches, intervals on copies of the set.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/report/message/write_report.h"
#include "tests/hidden_effects/score/arms/test_objects.h"
#include "tests/hidden_effects/score/judge.h"

namespace touchstone::hidden {

// What Compare finds with the report's improved model (the nominal one if there is none) on the same set, us. An error
// if the saved model cannot be read or compared.
absl::StatusOr<double> FinalRmseFoundAgainUs(const Set& set, const v1::Report& report,
                                             const TestObjects& objects);

// The same on fresh touches: another set of the same scenario, with other poses and noise.
absl::StatusOr<double> FreshRmseUs(const Scenario& truth, uint64_t seed, const v1::Report& report,
                                   const TestObjects& objects);

// A whole effect, an item of the list with or without that list around it, added to a model file.
std::string WithEffect(const std::string& model_yaml, const std::string& effect_yaml);

// What the nominal model with this effect leaves of its mean square misfit, on fresh touches with the same physics
// and without noise, as a share: infinite if it cannot be added, NaN if there is none.
double CutsTo(const Scenario& truth, uint64_t seed, const std::string& effect_yaml,
              const TestObjects& objects);

// The scenario with the values that the report gives to its one hidden effect, and the noise that it finds: what a copy
// of the set is drawn from, that is fitted anew to see whether intervals hold the values. Nothing where the effect was
// not named, or other values belong to it.
std::optional<Scenario> FittedCopy(const Scenario& truth, const v1::Report& report);

inline constexpr char kCopyCovers[] = "interval covers, simulated copies";

// A mark kCopyCovers for each value of `copies` sets drawn from the fitted copy and diagnosed again.
std::vector<Mark> CoverageOfCopies(const Arm& arm, const Scenario& truth, const v1::Report& report,
                                   uint64_t seed, int copies, const TestObjects& objects);

}  // namespace touchstone::hidden
