// Numbers by which fits go on and end, and by which evidence and held-out errors are computed.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::engine {

struct FitRules {
  Rule<int> max_iterations{
      "engine.fit.max_iterations",
      10,
      "",
      "Steps of Gauss and Newton that one fit takes at most.",
      "Cost: each step simulates the derivatives, or updates them, and predicts at least once.",
      "Smaller: fits far from their start end before the best values. Larger: fits that oscillate take "
      "longer."};
  Rule<double> converged{
      "engine.fit.converged",
      0.02,
      "nats",
      "A step that gains less ends a fit, of one kind of measurement or of several together.",
      "Argument: a fiftieth of the smallest difference of likelihoods that counts (1 nat).",
      "Larger: values stop before they are best. Smaller: more simulations for the same values."};
  Rule<double> small_step{
      "engine.fit.small_step",
      0.05,
      "standard errors",
      "Values that would move less have arrived, of a fit and of a rival in a plan.",
      "Not recorded.",
      "Larger: values stop before they are best. Smaller: more simulations for the same values."};
  Rule<int> max_halvings{"engine.fit.max_halvings",
                         5,
                         "",
                         "How often a step that lowers the likelihood is halved before the fit gives it up.",
                         "Cost: each halving predicts once.",
                         "Smaller: a fit ends where a shorter step would gain. Larger: fits at their best "
                         "value take longer to end."};
  Rule<int> min_updated{
      "engine.fit.min_updated",
      2,
      "",
      "Derivatives are updated (Broyden) in place of simulated where at least so many are smooth.",
      "Sets: photographs; with one or none, sets whose misfit is the camera's place took 10 to 30 % longer.",
      "Smaller: the steps that updating adds take longer than what it saves. Larger: more simulations."};
  Rule<double> derivative_step{
      "engine.fit.derivative_step",
      0.02,
      "share",
      "Step of derivatives over a parameter's scale, where the rows do not ask for another.",
      "Not recorded.",
      "Smaller: rounding shows in derivatives. Larger: curvature does."};
  Rule<int> folds{
      "engine.fit.folds",
      5,
      "",
      "Parts of the blocks, and stretches of the time, that are left out in turn for held-out errors.",
      "Not recorded.",
      "Smaller: fits without a part know less. Larger: more fits per held-out error."};
  Rule<double> uninformed{
      "engine.fit.uninformed",
      1e-3,
      "share",
      "A value of which the other rows hold a smaller share of the derivative's squares starts at no change.",
      "Not recorded.",
      "Not measured."};
  Rule<int> refit_iterations{"engine.fit.refit_iterations",
                             4,
                             "",
                             "Steps of a fit without one part.",
                             "Cost: a refit per part; it begins where the whole fit ended.",
                             "Smaller: held-out errors are those of values on their way. Larger: slower."};
  Rule<double> visible{
      "engine.fit.visible",
      10,
      "",
      "Squared scale over standard error at which a direction of the values counts as half seen.",
      "Not recorded.",
      "Smaller: weak directions cost more evidence. Larger: values that the rows hardly show cost nothing."};
  Rule<double> prior_width{"engine.fit.prior_width",
                           10,
                           "",
                           "Width of a value's prior (Cauchy) over the size that rigs show.",
                           "Not recorded.",
                           "Smaller: values larger than usual cost more evidence. Larger: they cost less."};
  Rule<double> unusual_nats{"engine.fit.unusual_nats",
                            7,
                            "nats",
                            "What a value beyond the usual range costs in evidence.",
                            "Argument: one rig in a thousand (log 1000 = 6.9).",
                            "Smaller: an unusual value is preferred to a second effect. Larger: a true one "
                            "is split among several."};
  Rule<double> ridge{"engine.fit.ridge",
                     1e-4,
                     "",
                     "Prior precision of a value over 1 / scale^2.",
                     "Argument: holds what nothing determines.",
                     "Smaller: undetermined values run off. Larger: weak values are drawn to no change."};
  Rule<int> max_support_points{
      "engine.fit.max_support_points",
      160,
      "",
      "Points of an object at which the smooth error of its surface is described, at most.",
      "Cost: time grows with its square or more.",
      "Smaller: short correlation lengths are described coarsely. Larger: slower."};
  Rule<int> max_columns_with_inner{"engine.fit.max_columns_with_inner",
                                   128,
                                   "",
                                   "Columns up to which the inner products of all of them are kept.",
                                   "Cost: their number grows with its square.",
                                   "Not measured."};
  Rule<int> resamples{"engine.fit.resamples",
                      200,
                      "",
                      "Draws of blocks of which a resampled covariance is made.",
                      "Not recorded.",
                      "Smaller: standard errors scatter more (by 5 % at 200). Larger: slower."};
  Rule<int> min_distinct_blocks{"engine.fit.min_distinct_blocks",
                                3,
                                "",
                                "A draw with fewer different blocks is left out of the covariance.",
                                "Argument: fewer need not determine the values at all.",
                                "Not measured."};
};
inline constexpr FitRules kFitRules;

}  // namespace touchstone::diagnosis::engine
