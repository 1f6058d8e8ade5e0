// Numbers by which a verdict is withheld, and by which answers beside the diagnosis are cut.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis {

struct AnswerRules {
  Rule<int> fitted_values{
      "answers.fitted_values",
      7,
      "degrees of freedom",
      "Values that a verdict must leave room for.",
      "Argument: object_pose, the largest effect of the catalogue, takes six and the noise one.",
      "Smaller: a fit of seven values to twelve numbers finds an effect in anything."};
  Rule<int> spare_degrees_of_freedom{
      "answers.spare_degrees_of_freedom",
      24,
      "degrees of freedom",
      "... and what must be left beside them; with fewer contrasts there is no verdict.",
      "Argument: a misfit that doubles the noise's variance shows; F is above 1.8 in 1 of 100 cases (8: "
      "above 2.5).",
      "Smaller: verdicts by chance. Larger: small sets get none."};
  Rule<int> min_poses{"answers.min_poses",
                      4,
                      "",
                      "Different touches that a verdict needs.",
                      "Argument: repeats of one touch say nothing of the model.",
                      "Not measured."};
  Rule<size_t> max_deciding{"answers.max_deciding",
                            5,
                            "",
                            "Touches that are named as speaking for an effect, and against it.",
                            "Display: examples.",
                            "Not measured."};
  Rule<size_t> max_session_pairs{"answers.max_session_pairs",
                                 8,
                                 "",
                                 "Pairs of sessions whose shared poses are compared.",
                                 "Display: as many as a person reads.",
                                 "Not measured."};
  Rule<double> at_bound{
      "answers.at_bound",
      1e-6,
      "share",
      "Of a value's range: nearer to a bound, without a larger standard error, it is warned of.",
      "Not recorded.",
      "Not measured."};
};
inline constexpr AnswerRules kAnswerRules;

}  // namespace touchstone::diagnosis
