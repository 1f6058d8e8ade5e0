// Numbers by which residuals of touches and of photographs are described alike (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::residuals {

struct ResidualRules {
  Rule<int> curve_bins{"residuals.curve_bins",
                       12,
                       "",
                       "Bins of a residual over a covariate, of equal content.",
                       "Not recorded.",
                       "Larger: fewer touches or pixels in each."};
  Rule<int> permutations{
      "residuals.permutations",
      499,
      "",
      "Permutations of two samples, and of curves of photographs.",
      "Argument: the least p that is counted is 1 / 500; beyond it a chi-square is fitted.",
      "Larger: slower. Smaller: p values scatter more."};
  Rule<int> slice_tries{"residuals.slice_tries",
                        8,
                        "",
                        "Candidates for each slice that are checked on the other half of the poses.",
                        "Not recorded.",
                        "Larger: chance agrees more often. Smaller: slices are missed."};
  Rule<double> min_slice_share{"residuals.min_slice_share",
                               0.03,
                               "share",
                               "Of the excess error, for a slice to be worth reporting.",
                               "Not recorded.",
                               "Smaller: slices that say little."};
  Rule<double> certain_slice_z{"residuals.certain_slice_z",
                               1.8,
                               "standard errors",
                               "What the other half must show of a slice where the misfit of the set is "
                               "certain; poses are what is independent.",
                               "Argument: a slice of a few poses cannot reach four.",
                               "Smaller: slices that chance makes."};
  Rule<double> one_sided_share{
      "residuals.one_sided_share",
      0.2,
      "share",
      "Of a slice's excess error in its mean, to call it early or late, brighter or darker.",
      "Not recorded.",
      "Smaller: what has both signs is called one."};
};
inline constexpr ResidualRules kResidualRules;

}  // namespace touchstone::diagnosis::residuals
