// Numbers by which extensions are scored and fitted, and rows that are set aside judged. What callers may set: SearchRules.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::engine {

struct CandidateRules {
  Rule<double> near_prediction_nats{
      "engine.search.near_prediction_nats",
      40,
      "nats",
      "Candidates that are predicted further behind the best one are not fitted.",
      "Cost: every candidate within it is fitted, up to SearchRules::max_refits.",
      "Smaller: a candidate whose prediction is poor is never fitted. Larger: more fits."};
  Rule<double> poor_prediction_share{
      "engine.search.poor_prediction_share",
      0.5,
      "share",
      "... or, of effects in the place of a step, further than this share of the step's evidence.",
      "Argument: a linearised prediction is good to about a share of what there is to explain.",
      "Smaller: competing effects of strong steps are not fitted. Larger: more fits."};
  Rule<int> formula_starts{"engine.search.formula_starts",
                           8,
                           "",
                           "Starts all over the bounds from which a user's formula is fitted.",
                           "Argument: nothing is known of it.",
                           "Smaller: a fit ends in a local maximum. Larger: as many more fits per formula."};
  Rule<size_t> max_pairs{"engine.search.max_pairs",
                         3,
                         "",
                         "Pairs of extensions that are fitted in full where no single one is enough.",
                         "Cost: a fit each.",
                         "Smaller: the right pair may not be fitted. Larger: more fits."};
  Rule<double> negligible_share{
      "engine.search.negligible_share",
      1e-3,
      "share",
      "Squares of a held-out part below this share of the noise's square are no difference between fits.",
      "Not recorded.",
      "Not measured."};
  Rule<double> swap_equal_nats{
      "engine.search.swap_equal_nats",
      0.5,
      "nats",
      "Gain that an effect needs to take the place of another where it has no more values.",
      "Not recorded.",
      "Smaller: effects that explain the same change places. Larger: a wrong first choice stays."};
  Rule<double> visible_change{
      "engine.search.visible_change",
      1e-9,
      "s",
      "Root mean square change of the rows, at a value's typical size, below which an extension is "
      "invisible.",
      "Argument: a thousandth of what files hold (1 us). Other kinds: in the unit of their rows.",
      "Not measured."};
  Rule<size_t> max_exact_on_one{
      "engine.search.max_exact_on_one",
      12,
      "",
      "Effects on one object, best by an estimate, that are scored under every hypothesis.",
      "Cost: a hypothesis each.",
      "Smaller: an effect whose estimate is poor is not found on its object. Larger: slower."};
  Rule<double> max_over_typical{
      "engine.search.max_over_typical",
      20,
      "",
      "Largest size that is tried, over the size that rigs show.",
      "Not recorded; acceleration ramps show at no small size.",
      "Smaller: effects that show at large sizes only are called invisible. Larger: more simulations."};
  Rule<double> min_over_typical{"engine.search.min_over_typical",
                                0.2,
                                "",
                                "Smallest size on the grid, over the size that rigs show.",
                                "Not recorded.",
                                "Not measured."};
  Rule<double> grid_factor{"engine.search.grid_factor",
                           1.5,
                           "",
                           "A size on the grid over the one before it.",
                           "Cost: a simulation per size.",
                           "Larger: the fit starts farther from the best size. Smaller: more simulations."};
  Rule<double> few_share{
      "engine.search.few_share",
      0.01,
      "share",
      "Of the measurements: more that are set aside are a finding.",
      "Argument: more are no slips of single readings.",
      "Smaller: single slips forbid ADEQUATE. Larger: a part that the model misses goes unsaid."};
  Rule<double> slips_share{
      "engine.search.slips_share",
      0.005,
      "share",
      "Of the measurements: as many single slips are no finding, however far off they lie.",
      "Not recorded.",
      "Smaller: one wild reading is a finding in short sets. Larger: far more may be wrong unsaid."};
  Rule<double> far_above_noise{
      "engine.search.far_above_noise",
      1.3,
      "",
      "Error with what is set aside, over the noise, above which it is a finding.",
      "Argument: a few gross errors do not bring that about.",
      "Smaller: chance makes findings. Larger: structure among what is set aside goes unsaid."};
  Rule<double> together_p{
      "engine.search.together_p",
      1e-3,
      "probability",
      "Rows that are set aside stand together where chance is less probable, over all divisions.",
      "Not recorded.",
      "Larger: chance makes findings. Smaller: groups go unsaid."};
  Rule<double> beyond_noise_share{
      "engine.search.beyond_noise_share",
      1e-4,
      "share",
      "Of the measurements, that noise alone may set aside: what their number is compared with.",
      "Not recorded.",
      "Not measured."};
};
inline constexpr CandidateRules kCandidateRules;

}  // namespace touchstone::diagnosis::engine
