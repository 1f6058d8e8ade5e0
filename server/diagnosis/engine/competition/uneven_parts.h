// When parts of a set (objects, stretches of the session, grey levels) scatter by amounts that clearly differ: one rule for
// every kind of measurement.
#pragma once

#include <cmath>
#include <optional>
#include <string>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/engine/competition/rules.h"

namespace touchstone::diagnosis::engine {

// Gains of log likelihood below this are what `parts` scales among `count` measurements gain by chance.
inline double EnoughToBeUneven(double parts, double count) {
  return kCompetitionRules.uneven_nats + 0.5 * (parts - 1) * std::log(count);
}

// `gain_nats`: of log likelihood, of a scale for each of `parts` parts over one for all. Nothing where one scale says the
// same. The p-value is of this way to part the set alone.
inline std::optional<CovariateTest> TestUneven(const std::string& covariate, double gain_nats, double parts,
                                               double count, double smallest_scale, double largest_scale) {
  const double enough = EnoughToBeUneven(parts, count);
  if (gain_nats < enough || largest_scale < kCompetitionRules.uneven_ratio * smallest_scale)
    return std::nullopt;
  return CovariateTest{covariate, ChiSquaredTail(2 * gain_nats, parts - 1),
                       gain_nats - enough + kCompetitionRules.uneven_nats.value()};
}

}  // namespace touchstone::diagnosis::engine
