// Numbers by which bumps of a surface are told from other misfits (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::selection {

struct SurfaceRules {
  Rule<double> likely{"selection.surface.likely",
                      0.5,
                      "probability",
                      "Bumps are named where they are more probable than this.",
                      "Argument: more likely than not.",
                      "Smaller: errors of poses are bumps. Larger: faint bumps stay without a name."};
  Rule<double> sure{"selection.surface.sure",
                    0.95,
                    "probability",
                    "... and than this where their length is the shortest that is tried.",
                    "Not recorded.",
                    "Smaller: errors of each pose are bumps. Larger: fine bumps stay without a name."};
  Rule<double> unlikely{"selection.surface.unlikely",
                        0.2,
                        "probability",
                        "A misfit is said to be no bumps where these are less probable than this.",
                        "Not recorded.",
                        "Smaller: misfits stay without words. Larger: faint bumps are said to be none."};
  Rule<double> elsewhere{"selection.surface.elsewhere",
                         5,
                         "nats",
                         "... and where something else explains it better than chance by more.",
                         "Not recorded.",
                         "Smaller: chance has an explanation. Larger: misfits stay without words."};
  Rule<double> rare_odds{
      "selection.surface.rare_odds",
      0.1,
      "",
      "Prior odds of rare explanations: bumps that each finger sees its own way, a curve.",
      "Argument: they are rarer than bumps and errors of poses. The number is not recorded.",
      "Smaller: curves are bumps. Larger: bumps are curves."};
  Rule<double> per_share_error{
      "selection.surface.per_share_error",
      2,
      "nats",
      "What poses left out say for each standard error of the share that is predicted there.",
      "Sets: of sets with faint bumps nine in ten had more than one error, of sets with errors of poses one "
      "in seven.",
      "Smaller: evidence that takes errors for Gaussian decides. Larger: the poses left out decide alone."};
  Rule<double> neutral_share_errors{
      "selection.surface.neutral_share_errors",
      0.7,
      "standard errors",
      "A share predicted at poses left out that speaks neither for bumps nor against them.",
      "Sets: as per_share_error.",
      "Smaller: errors of poses are bumps. Larger: faint bumps stay without a name."};
  Rule<double> max_share{
      "selection.surface.max_share",
      3,
      "nats",
      "The most that poses left out say, for bumps or against them.",
      "Sets: as per_share_error.",
      "Smaller: evidence that takes errors for Gaussian decides. Larger: the poses left out decide alone."};
  Rule<double> unseen{
      "selection.surface.unseen",
      0.9,
      "probability",
      "The most for bumps where poses left out show less than one standard error.",
      "Argument: what predicts nothing is not asserted. Of 60 sets with errors of each pose none was above.",
      "Smaller: faint bumps look doubtful. Larger: errors of poses look like certain bumps."};
  Rule<int> folds{"selection.surface.folds",
                  8,
                  "",
                  "Parts of the poses that are left out in turn.",
                  "Cost: each is a solution. The number is not recorded.",
                  "Smaller: the surface is fitted to less. Larger: a slower diagnosis."};
  Rule<int> knots_per_curve{"selection.surface.knots_per_curve",
                            24,
                            "",
                            "Places that stand for a curve's range.",
                            "Cost: the size of a covariance. The number is not recorded.",
                            "Smaller: fine curves are smoothed. Larger: a slower diagnosis."};
  Rule<double> apart{"selection.surface.apart",
                     100,
                     "",
                     "Ranges between curves, or surfaces, of two fingers or objects: they share nothing.",
                     "Argument: so far apart they share nothing.",
                     "Smaller: one finger's curve depends on another's. Larger: no change."};
  Rule<double> usual_min{"selection.surface.usual_min",
                         0.05,
                         "mm",
                         "Bumps that are smaller are said to be less than most printing and milling leave.",
                         "Not recorded. The sentence names it.",
                         "Smaller: only the words change. Larger: only the words change."};
  Rule<double> usual_max{"selection.surface.usual_max",
                         0.3,
                         "mm",
                         "Bumps that are larger are said to be more than printing and milling leave.",
                         "Not recorded. The sentence names it.",
                         "Smaller: only the words change. Larger: only the words change."};
  Rule<double> min_own_ratio{
      "selection.surface.min_own_ratio",
      0.08,
      "",
      "The smallest size of errors of each pose, as rows, over those that all have alike.",
      "Not recorded.",
      "Larger: small ones are missed. Smaller: each size counts for less."};
  Rule<double> max_own_ratio{
      "selection.surface.max_own_ratio",
      35,
      "",
      "The largest such size.",
      "Not recorded.",
      "Smaller: errors on steep faces only are missed. Larger: each size counts for less."};
  Rule<double> own_ratio_step{"selection.surface.own_ratio_step",
                              1.5,
                              "",
                              "From one such size to the next.",
                              "Cost: each is a likelihood. The number is not recorded.",
                              "Smaller: time for nothing. Larger: sizes between two are missed."};
  Rule<int> max_map_points{
      "selection.surface.max_map_points",
      400,
      "",
      "A map of a surface has at most so many points of one object.",
      "Cost: the cube of the points, and the size of the file. The number is not recorded.",
      "Smaller: fine bumps are smoothed. Larger: a slower fit and a larger file."};
};

inline constexpr SurfaceRules kSurfaceRules;

}  // namespace touchstone::diagnosis::selection
