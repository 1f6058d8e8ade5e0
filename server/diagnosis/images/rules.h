// Numbers by which photographs are diagnosed, of this folder and of several rooms below it (server/diagnosis/RULES.md lists all
// rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::images {

struct ImageRules {
  Rule<int> min_poses{"images.min_poses",
                      6,
                      "",
                      "Photographs of fewer poses get no verdict but TOO_LITTLE_DATA.",
                      "Not recorded.",
                      "Smaller: values from few poses count."};
  Rule<double> clear_misfit{
      "images.clear_misfit",
      1.2,
      "sigma",
      "From this error over the noise on a misfit is no matter of contours: a rest, or more steps, are "
      "looked for.",
      "Argument: rows hardly count contours, which are point-sampled; such an error is none of theirs.",
      "Larger: causes that show at contours alone pass as adequate. Smaller: sampling is told as a rest."};
  Rule<double> rest_p{
      "images.rest_p",
      1e-4,
      "probability",
      "Less likely by chance, what is left counts: a misfit, a dependence, a formula or a curve.",
      "Not recorded.",
      "Larger: chance is told. Smaller: small rests are missed."};
  Rule<double> curve_gain{"images.curve_gain",
                          0.01,
                          "share",
                          "A dependence takes more than this of the mean square of unseen pictures.",
                          "Not recorded.",
                          "Smaller: dependences that do not matter are told."};
  Rule<double> albedo_nats{"images.albedo_nats",
                           5,
                           "nats",
                           "Evidence of a smooth error of the albedo over none, from which it is told.",
                           "Not recorded.",
                           "Smaller: patches that noise makes are told."};
  Rule<double> max_doubted{"images.max_doubted",
                           0.5,
                           "probability",
                           "The most that a candidate is where no step was worth its entry.",
                           "Argument: what was not good enough for a step is not probable.",
                           "Not measured."};
  Rule<int> folds{"images.folds",
                  5,
                  "",
                  "Into so many parts the poses are cut; what is fitted to the others is tried on each.",
                  "Not recorded; kKindFolds, the size of an array, has the same number.",
                  "Not measured."};
  Rule<int> object_cells{"images.object_cells",
                         6,
                         "",
                         "Cells along each side of an object's box, for light that stays at its places.",
                         "Not recorded.",
                         "Larger: finer patches, fewer pixels in each."};

  // The noise of pixels as a step.
  Rule<double> min_sigma_grey{"images.min_sigma_grey",
                              0.15,
                              "grey levels",
                              "A smaller noise than this, not growing with the light, is no step.",
                              "Argument: less is rounding.",
                              "Smaller: rounding is told as noise."};
  Rule<double> seen_errors{
      "images.seen_errors", 4,
      "standard errors",    "From there on noise grows with the light, or differs from the model's.",
      "Not recorded.",      "Smaller: chance changes the noise."};
  Rule<double> seen_share{"images.seen_share",
                          0.05,
                          "share",
                          "And it differs by this of its value from the model's.",
                          "Not recorded.",
                          "Smaller: differences that do not matter are told."};
  Rule<double> noise_at_grey{"images.noise_at_grey",
                             127,
                             "grey levels",
                             "At this grey level the two noises are compared.",
                             "Argument: the middle of the range.",
                             "Not measured."};

  // Budgets.
  Rule<int> max_budget_photographs{"images.max_budget_photographs",
                                   12,
                                   "",
                                   "So many photographs, evenly chosen, are simulated for a budget.",
                                   "Cost: each is simulated twice per value.",
                                   "Larger: slower."};
};
inline constexpr ImageRules kImageRules;

}  // namespace touchstone::diagnosis::images
