// Numbers of formulas, curves and courses in time (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::selection {

struct CurveRules {
  Rule<double> min_gain{"selection.curves.min_gain",
                        10,
                        "nats",
                        "What a curve must gain to be significant.",
                        "Sets: calibrated on sets without a hidden effect.",
                        "Smaller: chance makes curves. Larger: weak rests stay without a curve."};
  Rule<double> min_held_out_gain{
      "selection.curves.min_held_out_gain",
      0.003,
      "share",
      "... and by which it must lower the error on touches that were left out.",
      "Not recorded. SearchRules.min_relative_cv_gain has the same number.",
      "Smaller: curves that hold only where they were fitted. Larger: weak rests stay without a curve."};
  Rule<double> worth_all{
      "selection.curves.worth_all",
      2,
      "nats",
      "A curve that gains more under the likeliest surface is fitted under all of them.",
      "Cost: under all surfaces a curve takes many times as long.",
      "Smaller: a slower search for nothing. Larger: gains of curves near the threshold are inexact."};
  Rule<double> negligible_surface{"selection.curves.negligible_surface",
                                  30,
                                  "nats",
                                  "Hypotheses of the surface this far behind the best take no part.",
                                  "Cost: exp(-30) of a sum does not show.",
                                  "Smaller: gains change. Larger: time for nothing."};
  Rule<int> knots{
      "selection.curves.knots",
      40,
      "",
      "Knots of a curve of time, or that all fingers share.",
      "Cost: columns of the fit. The number is not recorded.",
      "Smaller: fast courses are smoothed. Larger: sets with few touches have too few for the knots."};
  Rule<int> knots_per_finger{
      "selection.curves.knots_per_finger",
      20,
      "",
      "Knots of a curve of each finger over anything but time.",
      "Cost: columns of the fit, for each finger. The number is not recorded.",
      "Smaller: fine shapes are smoothed. Larger: sets with few touches have too few for the knots."};
  Rule<double> typical_curve{"selection.curves.typical_curve",
                             0.3e-3,
                             "m",
                             "The size of a curve that rigs show: scale of the prior.",
                             "Not recorded.",
                             "Smaller: large curves cost evidence. Larger: weak curves cost evidence."};
  Rule<int> bends{"selection.curves.bends",
                  8,
                  "",
                  "So many scales of a curve's bends are tried, each a third of the last.",
                  "Cost: each is a fit. The number is not recorded.",
                  "Smaller: nearly straight curves are too rough. Larger: time for nothing."};
  Rule<int> folds{"selection.curves.folds",
                  5,
                  "",
                  "Parts of the touches that are left out in turn to see whether a curve holds there.",
                  "Cost: each is a solution. A fifth is left out. The number is not recorded.",
                  "Smaller: curves are fitted to less. Larger: a slower diagnosis."};
  Rule<int> fold_stretches{
      "selection.curves.fold_stretches",
      60,
      "",
      "For a curve of time the session is cut into so many stretches, which the folds take in turn.",
      "Not recorded.",
      "Smaller: a curve must bridge longer gaps. Larger: neighbours in time stand on both sides."};
  Rule<double> near_share{"selection.curves.near_share",
                          0.5,
                          "share",
                          "A formula that gains this share of a curve's gain comes near it.",
                          "Not recorded. A nearest formula is named from half of the curve's gain on.",
                          "Smaller: formulas are named that miss the curve. Larger: none is named."};
  Rule<double> typical_travel{"selection.curves.typical_travel",
                              0.2e-3,
                              "m",
                              "The size of a formula's term that rigs show: scale of the prior.",
                              "Not recorded.",
                              "Smaller: large terms cost evidence. Larger: weak terms cost evidence."};
  Rule<int> periods{"selection.curves.periods",
                    40,
                    "",
                    "So many periods of the travel are tried.",
                    "Cost: each is two columns, and log(40) of evidence is paid for the choice.",
                    "Smaller: periods between two of the grid are missed. Larger: each pays more."};
  Rule<double> min_period{"selection.curves.min_period",
                          1.5,
                          "mm",
                          "The shortest period of the travel that is tried: a lead screw, a gear.",
                          "Not recorded.",
                          "Larger: fine screws are missed. Smaller: a coarser grid of periods."};
  Rule<double> max_period{"selection.curves.max_period",
                          40,
                          "mm",
                          "The longest period of the travel that is tried.",
                          "Not recorded.",
                          "Smaller: coarse screws are missed. Larger: a coarser grid of periods."};
  Rule<double> simple{
      "selection.curves.simple",
      0,
      "nats",
      "What a plain function of a covariate pays for its complexity, beside the price of any formula.",
      "Argument: what people would try first costs less.",
      "Larger: plain formulas give way to curves."};
  Rule<double> curved{"selection.curves.curved",
                      1.5,
                      "nats",
                      "What a curved function of a covariate pays for its complexity.",
                      "Argument: what people would try first costs less. The number is not recorded.",
                      "Smaller: squares where a line would do. Larger: lines where a square is true."};
  Rule<double> product{"selection.curves.product",
                       2,
                       "nats",
                       "What a product of two things pays that both differ between fingers.",
                       "Argument: what people would try first costs less. The number is not recorded.",
                       "Smaller: products where one factor would do. Larger: true products are missed."};
  Rule<int> even_slots{
      "selection.curves.even_slots",
      48,
      "",
      "Slots of the session, with as many touches each: where courses may begin and end.",
      "Cost: pairs of slots are stretches. The number is not recorded.",
      "Smaller: short stretches are missed. Larger: small sets have too few touches for the slots."};
  Rule<int> min_touches_per_slot{"selection.curves.min_touches_per_slot",
                                 3,
                                 "",
                                 "With fewer touches for each slot no course is looked for.",
                                 "Not recorded.",
                                 "Smaller: courses of single touches. Larger: small sets show no course."};
  Rule<int> fine_slots{"selection.curves.fine_slots",
                       12,
                       "",
                       "So many slots stand for each one round the beginning and the end of the best course.",
                       "Cost: pairs of slots are stretches. The number is not recorded.",
                       "Smaller: the touch at which a step begins is inexact. Larger: a slower search."};
  Rule<int> warm_ups{"selection.curves.warm_ups",
                     8,
                     "",
                     "So many time constants of a warm-up are tried.",
                     "Cost: each is a fit. The number is not recorded.",
                     "Smaller: time constants between two of the grid are missed. Larger: time for nothing."};
  Rule<double> shortest_warm_up{
      "selection.curves.shortest_warm_up",
      0.015,
      "share",
      "The shortest time constant of a warm-up, of the session.",
      "Not recorded.",
      "Smaller: single touches at the beginning look like one. Larger: short warm-ups are missed."};
  Rule<double> longest_warm_up{"selection.curves.longest_warm_up",
                               0.5,
                               "share",
                               "The longest time constant of a warm-up, of the session.",
                               "Not recorded.",
                               "Smaller: slow warm-ups are missed. Larger: drifts are warm-ups."};
  Rule<int> max_cycles{"selection.curves.max_cycles",
                       16,
                       "",
                       "Waves of at most so many cycles over the session are tried.",
                       "Argument: more cycles are a smooth curve's.",
                       "Smaller: fast waves are missed. Larger: a slower search, and each wave pays more."};
  Rule<int> frequencies_per_cycle{
      "selection.curves.frequencies_per_cycle",
      2,
      "",
      "So many frequencies are tried from one whole number of cycles to the next.",
      "Not recorded.",
      "Smaller: waves between two frequencies are missed. Larger: a slower search."};
  Rule<int> phases{"selection.curves.phases",
                   6,
                   "",
                   "So many phases of a wave are tried in half a cycle.",
                   "Not recorded.",
                   "Smaller: waves between two phases are missed. Larger: a slower search."};
  Rule<int> finer_waves{
      "selection.curves.finer_waves",
      4,
      "",
      "So many steps between two frequencies or phases are tried round the best wave.",
      "Not recorded.",
      "Smaller: period and phase are inexact. Larger: a slower search, and a wave pays more."};
  Rule<double> visible{
      "selection.curves.visible",
      1e-6,
      "share",
      "A course explains nothing if the fit's own columns leave no more of its square.",
      "Argument: less is rounding.",
      "Smaller: courses are fitted to rounding. Larger: courses are missed that effects nearly explain."};
  Rule<double> worth_refining{"selection.curves.worth_refining",
                              3,
                              "nats",
                              "A course that gains more is looked at on a finer grid.",
                              "Cost: the finer grid takes as long again. The number is not recorded.",
                              "Smaller: time for nothing. Larger: weak courses have an inexact place."};
  Rule<int> warm_up_knots{"selection.curves.warm_up_knots",
                          16,
                          "",
                          "Knots of the lookup that holds a warm-up.",
                          "Not recorded.",
                          "Smaller: the lookup is off between knots. Larger: a longer model file."};
  Rule<int> knots_per_cycle{"selection.curves.knots_per_cycle",
                            12,
                            "",
                            "Knots of the lookup that holds a wave, for each cycle.",
                            "Not recorded.",
                            "Smaller: the lookup is off between knots. Larger: a longer model file."};
};

inline constexpr CurveRules kCurveRules;

}  // namespace touchstone::diagnosis::selection
