// Numbers of histograms and permutation tests of residuals (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::residuals {

struct DistributionRules {
  Rule<size_t> max_poses{"residuals.distribution.max_poses",
                         20000,
                         "",
                         "So many poses a permutation test reads.",
                         "Cost: the poses times the permutations.",
                         "Larger: slower. Smaller: weak dependences of large sets are missed."};
  Rule<int> dependence_permutations{"residuals.distribution.dependence_permutations",
                                    200,
                                    "",
                                    "Permutations for a dependence of residuals on a covariate.",
                                    "Cost: every covariate is tested.",
                                    "Larger: slower."};
  Rule<double> within_poses{
      "residuals.distribution.within_poses",
      0.25,
      "share",
      "A covariate that varies by more within poses than this of all has touches exchanged, else poses.",
      "Argument: one that varies among the repeats of a pose (time, the previous press) is tested there.",
      "Not measured."};
  Rule<int> ranks{"residuals.distribution.ranks",
                  256,
                  "",
                  "Into so many parts of equal content the test of two samples sorts the values.",
                  "Cost: the parts times the permutations.",
                  "Smaller: fine differences are missed."};
  Rule<int> max_bins{"residuals.distribution.max_bins",
                     60,
                     "",
                     "Bins of a histogram at most.",
                     "Display: what a picture can show.",
                     "Test: ResidualHistograms.OfARightModelAgree."};
  Rule<size_t> max_plotted{"residuals.distribution.max_plotted",
                           200000,
                           "",
                           "About so many values of each sample set the edges of a histogram.",
                           "Cost: they are sorted.",
                           "Larger: slower."};
  Rule<size_t> max_parity_points{"residuals.distribution.max_parity_points",
                                 2000,
                                 "",
                                 "Points of measured over simulated times, spread over the session.",
                                 "Display: what a picture can show.",
                                 "Larger: larger reports."};
};
inline constexpr DistributionRules kDistributionRules;

}  // namespace touchstone::diagnosis::residuals
