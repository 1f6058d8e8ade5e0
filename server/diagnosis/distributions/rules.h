// Numbers by which sets without poses are compared with what a model makes.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::distributions {

struct DistributionRules {
  Rule<int> max_repeats{"distributions.max_repeats",
                        60,
                        "",
                        "Repeats of a touch that are looked for at most.",
                        "Cost: every number of repeats up to it is tried.",
                        "Not measured."};
  Rule<int> max_for_neighbours{"distributions.max_for_neighbours",
                               600,
                               "",
                               "Touches whose nearest neighbours are looked up.",
                               "Cost: distances to all touches for each.",
                               "Not measured."};
  Rule<double> max_repeat_distance{
      "distributions.max_repeat_distance",
      0.2,
      "",
      "Distance of repeats, over that of any two touches, at most.",
      "Not recorded.",
      "Smaller: noisy repeats are not found. Larger: similar touches count as repeats."};
  Rule<double> min_gap{"distributions.min_gap",
                       3,
                       "",
                       "Distance of the nearest other pose over that of the last repeat, at least.",
                       "Not recorded.",
                       "Not measured."};
  Rule<double> touch_interval_s{"distributions.touch_interval_s",
                                10,
                                "s",
                                "Time from touch to touch of the plan that is assumed.",
                                "Not recorded.",
                                "Not measured."};
  Rule<int> max_measured_touches{"distributions.max_measured_touches",
                                 1500,
                                 "",
                                 "Touches of a set that are compared, all objects together.",
                                 "Cost: distances grow with the square of an object's touches.",
                                 "Smaller: weak differences stay unseen."};
  Rule<int> reference_touches{
      "distributions.reference_touches",
      1200,
      "",
      "Touches of the simulated sample that sets are compared with, about, all objects together.",
      "Cost: as for measured touches.",
      "Smaller: distances scatter more."};
  Rule<int> max_reference_per_object{"distributions.max_reference_per_object",
                                     600,
                                     "",
                                     "... of one object.",
                                     "Cost: distances grow with its square.",
                                     "Not measured."};
  Rule<int> quick_touches{"distributions.quick_touches",
                          480,
                          "",
                          "... of a sample for looking at many models.",
                          "Cost: as for measured touches.",
                          "Smaller: the screening of effects is rougher."};
  Rule<int> max_quick_per_object{"distributions.max_quick_per_object",
                                 360,
                                 "",
                                 "... of one object.",
                                 "Cost: distances grow with its square.",
                                 "Not measured."};
  Rule<double> min_noise_change{
      "distributions.min_noise_change",
      3,
      "standard errors",
      "The model's noise is replaced where the scatter of repeats differs by more.",
      "Not recorded.",
      "Smaller: noise that is right is replaced by chance. Larger: wrong noise is taken for effects."};
  Rule<double> min_degrees_of_freedom{"distributions.min_degrees_of_freedom",
                                      20,
                                      "degrees of freedom",
                                      "Repeats with fewer leave the noise unknown.",
                                      "Not recorded.",
                                      "Not measured."};
  Rule<size_t> max_attempts{"distributions.max_attempts",
                            64,
                            "",
                            "How often a pose is drawn anew where the touch misses.",
                            "Cost: bounds the drawing.",
                            "Smaller: touches are missing in the simulated set."};
  Rule<double> suspicious_p{
      "distributions.suspicious_p",
      0.1,
      "probability",
      "Of the model with assumed poses: where it is not larger, poses are fitted before the verdict.",
      "Not recorded.",
      "Smaller: poses that are assumed wrongly are taken for a wrong model. Larger: more fits of poses."};
  Rule<double> small_p{
      "distributions.small_p",
      0.005,
      "probability",
      "A model is compatible where p is larger.",
      "Not recorded.",
      "Larger: right models are refused. Smaller: more simulated sets are needed (small_p_sets)."};
  Rule<double> wide_tilt_deg{
      "distributions.wide_tilt_deg",
      32,
      "deg",
      "Tilt of wide poses, which are tried beside the assumed and the fitted ones.",
      "Argument: poses fitted to a model that lacks an effect may be far from the right ones.",
      "Not measured."};
  Rule<double> wide_spread{
      "distributions.wide_spread",   0.62,           "share", "... and their spread over the faces.",
      "Argument: as wide_tilt_deg.", "Not measured."};
  Rule<int> enough_sets{"distributions.enough_sets",
                        10,
                        "",
                        "Simulated sets at least as far off as the measured one: then no more are made.",
                        "Argument: enough to know that p is not small.",
                        "Smaller: p is rougher. Larger: slower where the model is right."};
  Rule<int> first_sets{"distributions.first_sets",
                       39,
                       "",
                       "Simulated sets until p is roughly known.",
                       "Cost: each is simulated and compared.",
                       "Not measured."};
  Rule<int> some_sets{"distributions.some_sets",
                      99,
                      "",
                      "... at most where the poses may still be fitted.",
                      "Cost: as for first_sets.",
                      "Not measured."};
  Rule<int> small_p_sets{"distributions.small_p_sets",
                         219,
                         "",
                         "... after which there is an end where none is as far off.",
                         "Argument: the fewest that can show p < 0.005 (small_p).",
                         "Smaller: no model can be refused."};
  Rule<int> all_sets{"distributions.all_sets",
                     499,
                     "",
                     "... at most.",
                     "Cost: as for first_sets.",
                     "Smaller: p near small_p is rougher."};
  Rule<double> compatible_p{"distributions.compatible_p",
                            0.1,
                            "probability",
                            "An effect is named as compatible where sets with it have a larger p.",
                            "Not recorded.",
                            "Larger: true effects go unnamed. Smaller: more that do not fit are named."};
  Rule<double> clearly_compatible_p{"distributions.clearly_compatible_p",
                                    0.5,
                                    "probability",
                                    "Values with a larger p are not refined.",
                                    "Cost: no need to look for better ones.",
                                    "Not measured."};
  Rule<size_t> max_refined{"distributions.max_refined",
                           10,
                           "",
                           "Directions of effects that are refined after the screening.",
                           "Cost: comparisons at up to eight step sizes for each.",
                           "Smaller: a compatible effect may be missed."};
  Rule<int> max_refined_per_effect{"distributions.max_refined_per_effect",
                                   2,
                                   "",
                                   "... of one effect.",
                                   "Cost: as max_refined.",
                                   "Not measured."};
  Rule<int> max_moves{"distributions.max_moves",
                      3,
                      "",
                      "Moves in one direction per step of the refinement.",
                      "Cost: a comparison each.",
                      "Not measured."};
  Rule<double> tilt_step_deg{"distributions.tilt_step_deg",
                             6,
                             "deg",
                             "Step of the poses' tilt in the refinement.",
                             "Not recorded.",
                             "Not measured."};
  Rule<double> max_tilt_deg{"distributions.max_tilt_deg",
                            50,
                            "deg",
                            "Largest tilt of poses that is tried.",
                            "Not recorded.",
                            "Not measured."};
  Rule<double> spread_step{"distributions.spread_step",
                           0.1,
                           "share",
                           "Step of the poses' spread in the refinement.",
                           "Not recorded.",
                           "Not measured."};
  Rule<double> fine_step{"distributions.fine_step",
                         0.2,
                         "",
                         "Steps below it leave the poses alone.",
                         "Argument: a strength must be right to a few per cent, poses need not.",
                         "Not measured."};
  Rule<size_t> steps_before_renewal{
      "distributions.steps_before_renewal",
      2,
      "",
      "Steps after which sets are made anew by the best effect so far, to compare with.",
      "Not recorded.",
      "Not measured."};
  Rule<double> hopeless_p{
      "distributions.hopeless_p",
      0.01,
      "probability",
      "A direction with a smaller p and a misfit far above the best is not refined further.",
      "Cost: saves comparisons.",
      "Larger: effects are dropped that further steps would fit."};
  Rule<double> finding_p{"distributions.finding_p",
                         1e-4,
                         "probability",
                         "A finding among repeats (order, previous press, tails) needs a smaller p, paid for "
                         "all kinds of findings.",
                         "Sets: 60 without effect of a wedge and six of the trial raised none.",
                         "Larger: findings by chance. Smaller: weak ones go unsaid."};
  Rule<int> min_repeated{"distributions.min_repeated",
                         60,
                         "",
                         "Touches with repeats (times, for a tick) below which nothing is said.",
                         "Not recorded.",
                         "Not measured."};
  Rule<int> order_permutations{"distributions.order_permutations",
                               400,
                               "",
                               "Exchanges of the touches of a pose, against which their order is judged.",
                               "Cost: a statistic each.",
                               "Smaller: z scores are rougher."};
  Rule<int> gaussian_sets{"distributions.gaussian_sets",
                          200,
                          "",
                          "Sets of Gaussian noise of the same layout, against which tails are judged.",
                          "Cost: a statistic each.",
                          "Smaller: z scores are rougher."};
  Rule<double> min_effective{"distributions.min_effective",
                             30,
                             "",
                             "Independent terms of a sum that is called normal.",
                             "Not recorded.",
                             "Smaller: p of a press that differs within few poses is wrong."};
  Rule<double> max_press{"distributions.max_press",
                         6,
                         "",
                         "Deviations of the previous press beyond so many median ones are cut.",
                         "Not recorded.",
                         "Larger: few extreme presses decide. Smaller: a true after-effect is weakened."};
  Rule<int> tick_times{"distributions.tick_times",
                       400,
                       "",
                       "Times in which a tick is looked for.",
                       "Cost: a sum over them per frequency.",
                       "Not measured."};
  Rule<double> min_tick_s{"distributions.min_tick_s",
                          1e-3,
                          "s",
                          "Shortest tick that is looked for.",
                          "Cost: frequencies grow as its inverse.",
                          "Not measured."};
  Rule<double> tick_coherence{"distributions.tick_coherence",
                              0.9,
                              "",
                              "Coherence of the times at which a tick is found.",
                              "Not recorded.",
                              "Smaller: chance makes ticks. Larger: ticks with jitter go unsaid."};
  Rule<size_t> max_examples{"distributions.max_examples",
                            5,
                            "",
                            "Incomplete touches that are listed.",
                            "Display: examples.",
                            "Not measured."};
};
inline constexpr DistributionRules kDistributionRules;

}  // namespace touchstone::diagnosis::distributions
