// Numbers by which the steps of an explanation are told, doubted and completed (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::selection {

struct LadderRules {
  Rule<double> surface{
      "selection.ladder.surface",
      5,
      "nats",
      "Evidence that asks for a surface error by itself, and for words of a misfit that is none.",
      "Not recorded.",
      "Smaller: chance makes bumps. Larger: faint bumps stay a misfit."};
  Rule<double> surface_with_misfit{
      "selection.ladder.surface_with_misfit",
      1,
      "nats",
      "... and where the lack of fit says that something is left.",
      "Not recorded.",
      "Smaller: any misfit is asked about bumps. Larger: a misfit by faint bumps stays without a name."};
  Rule<double> misfit_p{
      "selection.ladder.misfit_p",
      1e-2,
      "probability",
      "A lack of fit less probable than this says that something is left, for a surface error.",
      "Not recorded.",
      "Smaller: faint bumps stay unasked. Larger: chance asks for bumps."};
  Rule<double> same_surface{
      "selection.ladder.same_surface",
      2.5,
      "",
      "Bumps up to so many times the model's own are those that it expects.",
      "Argument: an object has few of them, so that their size is known to such a factor.",
      "Smaller: the model's own bumps are a finding. Larger: bumps that are new are none."};
  Rule<double> length_error{"selection.ladder.length_error",
                            0.4,
                            "share",
                            "Relative standard error of the length of bumps.",
                            "Argument: the spacing of the grid of lengths.",
                            "Smaller: lengths look better known than the grid. Larger: worse."};
  Rule<int> many_effects{
      "selection.ladder.many_effects",
      3,
      "",
      "More effects at once, none near the size that rigs show, are doubted.",
      "Not recorded.",
      "Smaller: strong pairs of effects are doubted. Larger: four strange effects stand undoubted."};
  Rule<double> near_typical{"selection.ladder.near_typical",
                            5,
                            "",
                            "A size up to so many times the typical one is near it.",
                            "Not recorded.",
                            "Smaller: strong effects are doubted. Larger: strange values count as usual."};
  Rule<double> max_unusual{"selection.ladder.max_unusual",
                           0.9,
                           "probability",
                           "The most for a step that would need a larger value than rigs show.",
                           "Not recorded.",
                           "Smaller: true values of a bad set-up are doubted more. Larger: mistakes of the "
                           "set-up pass as certain."};
  Rule<double> few_poses_p{"selection.ladder.few_poses_p",
                           1e-4,
                           "probability",
                           "Beside a rest without a name, an effect is doubted if its values "
                           "differ from none by chance so often.",
                           "Argument: tenfold below what one effect in a hundred would show by chance.",
                           "Smaller: effects are doubted that other poses show too. Larger: a few poses with "
                           "large errors make an effect."};
  Rule<double> max_beside_other{
      "selection.ladder.max_beside_other",
      0.5,
      "probability",
      "The most for a step that something else may say as well: another scatter, a sum at two speeds.",
      "Argument: even odds of two that cannot be told apart.",
      "Smaller: true steps look improbable. Larger: wrong ones look probable."};
  Rule<double> rounds_possible_p{
      "selection.ladder.rounds_possible_p",
      0.05,
      "probability",
      "Agreement within rounds less probable than this doubts what the scatter looks like.",
      "Not recorded.",
      "Smaller: objects put down anew pass as noise. Larger: true noise is doubted by chance."};
  Rule<double> significant{"selection.ladder.significant",
                           3.3,
                           "standard errors",
                           "A value of noise changes if it is farther from the model's.",
                           "Not recorded. It is a two-sided p of 0.001.",
                           "Smaller: values change by chance. Larger: wrong values stay."};
  Rule<double> relevant{"selection.ladder.relevant",
                        0.02,
                        "share",
                        "... and by more than this share of itself.",
                        "Not recorded.",
                        "Smaller: large sets change values by what nobody needs. Larger: wrong values stay."};
  Rule<double> min_sigma{
      "selection.ladder.min_sigma",
      1.5e-6,
      "s",
      "Less noise of a reading is none.",
      "Argument: less is the rounding of the file.",
      "Smaller: rounding is named as noise. Larger: the noise of a very good rig goes unnamed."};
  Rule<double> min_floor{
      "selection.ladder.min_floor",
      2,
      "us",
      "A floor below this asks for no noise that the model lacks.",
      "Argument: less is the rounding of the file.",
      "Smaller: rounding is named as noise. Larger: the noise of a very good rig goes unnamed."};
  Rule<double> sigma_factor{
      "selection.ladder.sigma_factor",
      2,
      "",
      "Sigma over the model's, or the inverse, beyond which the model's value is wrong.",
      "Argument: sigma is estimated anew by every diagnosis; off by a factor it is a wrong value.",
      "Smaller: noise that varies from day to day is a finding. Larger: wrong values go unsaid."};
  Rule<double> certain{
      "selection.ladder.certain",
      1e3,
      "nats",
      "Evidence that stands for noise that is there.",
      "Argument: any scatter beyond rounding proves it.",
      "Smaller: noise that is there may look uncertain. Larger: no change; 0.999 is the most that is said."};
  Rule<size_t> max_covariates{
      "selection.ladder.max_covariates",
      6,
      "",
      "So many covariates of a rest are listed.",
      "Display: a list that a reader takes in. The number is not recorded.",
      "Smaller: a cause may be missing from the list. Larger: a list that nobody reads."};
  Rule<double> covariate_p{"selection.ladder.covariate_p",
                           0.01,
                           "probability",
                           "A covariate is listed if chance gives its best term less often, over all terms.",
                           "Not recorded.",
                           "Smaller: weak dependences are not listed. Larger: chance lists covariates."};
  Rule<int> max_span{"selection.ladder.max_span",
                     8,
                     "",
                     "An effect with more columns is not compared with a formula.",
                     "Argument: effects with more of them look like anything.",
                     "Smaller: effects of each object are not named as nearest. Larger: they always are."};
  Rule<int> max_measured_places{
      "selection.ladder.max_measured_places",
      400,
      "",
      "So many places of one object are kept as where it was measured.",
      "Cost: reports hold them. The number is not recorded.",
      "Smaller: predictions between two places seem far from data. Larger: larger reports."};
};

inline constexpr LadderRules kLadderRules;

}  // namespace touchstone::diagnosis::selection
