// Numbers by which formulas and curves are suggested for what photographs leave (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::images {

struct PhotoTermRules {
  // What is tried.
  Rule<double> curved_nats{"images.terms.curved_nats",
                           1.5,
                           "nats",
                           "What a bent term, or one times the grey level, costs beyond a straight line.",
                           "Not recorded.",
                           "Smaller: bent terms stand for straight ones."};
  Rule<double> wave_nats{"images.terms.wave_nats",
                         3,
                         "nats",
                         "The same of a wave.",
                         "Not recorded.",
                         "Smaller: waves stand for straight lines."};
  Rule<int> max_waves{"images.terms.max_waves",
                      10,
                      "",
                      "Waves over the picture's height or width, or the session, at most.",
                      "Cost: more terms.",
                      "Larger: finer patterns, more terms that chance may choose."};
  Rule<int> curve_knots{"images.terms.curve_knots",
                        9,
                        "",
                        "Knots of a curve.",
                        "Not recorded.",
                        "Larger: finer curves, more values to fit."};
  Rule<double> prior_grey{"images.terms.prior_grey",
                          10,
                          "grey levels",
                          "What a term or a curve adds, as their prior has it, root mean square.",
                          "Not recorded.",
                          "Larger: each costs more evidence. Smaller: large ones are cut."};
  Rule<double> max_pixels{"images.terms.max_pixels",
                          250'000,
                          "",
                          "So many pixels of all photographs sums are taken over.",
                          "Cost: the time of the sums.",
                          "Larger: slower. Smaller: small terms are missed."};
  Rule<int> map_cells{"images.terms.map_cells",
                      12,
                      "",
                      "Cells along a side of a picture, of the nameless competitor.",
                      "Not recorded.",
                      "Larger: finer stains, fewer pixels in each."};
  Rule<double> min_reciprocal_condition{"images.terms.min_reciprocal_condition",
                                        1e-10,
                                        "",
                                        "Of scaled columns: below it values are not determined.",
                                        "Argument: rounding of doubles.",
                                        "Smaller: digits of rounding count."};

  // What is suggested.
  Rule<double> picked_nats{"images.terms.picked_nats",
                           11,
                           "nats",
                           "What a term pays that was picked from a dictionary.",
                           "Not recorded.",
                           "Smaller: terms that chance chose are suggested."};
  Rule<double> enter_nats{"images.terms.enter_nats",
                          4.5,
                          "nats",
                          "What a term or a curve must gain beyond what it pays.",
                          "Not recorded.",
                          "Smaller: terms that chance chose are suggested."};
  Rule<double> min_held{"images.terms.min_held",
                        0.5,
                        "share",
                        "Of what is taken where it was fitted, unseen poses must lose so much too.",
                        "Not recorded.",
                        "Smaller: what single poses have is suggested."};
  Rule<double> of_nameless{
      "images.terms.of_nameless",
      0.8,
      "share",
      "Of what grey levels that stay at their places take from unseen poses, a suggestion takes so much.",
      "Argument: dirt on the lens must get no formula.",
      "Smaller: dirt gets one. Larger: formulas beside dirt go."};
  Rule<double> min_excess{"images.terms.min_excess",
                          0.2,
                          "share",
                          "Of the excess error on unseen pictures, a suggestion takes so much.",
                          "Not recorded.",
                          "Smaller: suggestions that do little are made."};
  Rule<double> formula_of_curve{"images.terms.formula_of_curve",
                                0.9,
                                "share",
                                "A formula that takes so much of what a curve takes stands in its place.",
                                "Argument: it says the same in fewer values.",
                                "Smaller: formulas that fit worse."};
  Rule<size_t> max_tried{"images.terms.max_tried",
                         4,
                         "",
                         "Formulas that are simulated, most evident first.",
                         "Cost: a simulation of all pictures each.",
                         "Larger: slower."};
};
inline constexpr PhotoTermRules kPhotoTermRules;

}  // namespace touchstone::diagnosis::images
