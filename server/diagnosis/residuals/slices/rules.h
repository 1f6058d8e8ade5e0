// Numbers by which the parts of a set are found in which a model is wrong (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::residuals {

struct SliceRules {
  // The search for slices.
  Rule<int> max_slices{"residuals.slices.max_slices",
                       6,
                       "",
                       "Slices of touches that are reported.",
                       "Display: what a reader can take in.",
                       "Larger: longer reports."};
  Rule<int> max_touches{"residuals.slices.max_touches",
                        30000,
                        "",
                        "About so many touches slices are searched in, whole poses.",
                        "Cost: the touches times the pairs of covariates.",
                        "Larger: slower."};
  Rule<double> min_z{"residuals.slices.min_z",
                     4,
                     "standard errors",
                     "What the other half must show of a slice where the misfit of the set is not certain.",
                     "Not recorded.",
                     "Smaller: slices that chance makes."};
  Rule<double> certain_misfit{
      "residuals.slices.certain_misfit",
      10,
      "standard errors",
      "From this excess over noise on a misfit is certain: kResidualRules.certain_slice_z is enough.",
      "Argument: a slice of a few poses cannot reach four.",
      "Smaller: slices that chance makes."};
  Rule<size_t> min_poses{"residuals.slices.min_poses",
                         5,
                         "",
                         "So many poses a slice has in each half, or it shows nothing.",
                         "Not recorded.",
                         "Smaller: the scatter of poses is hardly known."};
  Rule<int> thresholds{
      "residuals.slices.thresholds",
      14,
      "",
      "About so many thresholds are tried of a continuous covariate.",
      "Not recorded.",
      "Larger: finer slices, more that chance may choose. At most SliceBins::kMax - 1 count."};
  Rule<size_t> few_levels{"residuals.slices.few_levels",
                          8,
                          "",
                          "Up to so many distinct numbers are levels (\"speed = 20 mm/s\"), not a scale.",
                          "Display: levels read more easily.",
                          "Larger: scales are read number by number."};
  Rule<double> second_condition{"residuals.slices.second_condition",
                                0.85,
                                "",
                                "A second condition, or end of a range, multiplies the score by this.",
                                "Argument: it must gain more than it costs to read.",
                                "Larger: slices of two conditions where one says it."};
  Rule<double> one_condition_keeps{"residuals.slices.one_condition_keeps",
                                   0.75,
                                   "share",
                                   "A simpler slice that scores this of another replaces it.",
                                   "Argument: it is easier to read.",
                                   "Larger: two conditions where one says it."};

  // Curves, and two models on the same touches.
  Rule<int> max_curve_touches{"residuals.slices.max_curve_touches",
                              60000,
                              "",
                              "About so many touches curves are made of, whole poses.",
                              "Cost: the touches times the covariates.",
                              "Larger: slower."};
  Rule<int> bootstrap_draws{"residuals.slices.bootstrap_draws",
                            1000,
                            "",
                            "Draws of poses for the difference of two models' errors.",
                            "Argument: its 2.5 % quantile is the 25th of a thousand.",
                            "Larger: slower."};
  Rule<size_t> max_deciding{"residuals.slices.max_deciding",
                            10,
                            "",
                            "Touches that speak most for either of two models, that are shown.",
                            "Display: what a reader can take in.",
                            "Larger: longer reports."};
};
inline constexpr SliceRules kSliceRules;

}  // namespace touchstone::diagnosis::residuals
