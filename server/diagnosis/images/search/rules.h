// Numbers by which the search for what photographs lack decides (server/diagnosis/RULES.md lists all rooms). Where a number is one
// of engine::SearchRules or PhotoRowsOptions the row says which.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::images {

struct PhotoSearchRules {
  // Rows: cells of a picture (PhotoRowsOptions::cells), passes over the directions (smoothing), pictures that are seen
  // (max_photographs).
  Rule<int> far_cells{"images.search.far_cells",
                      196,
                      "",
                      "Cells of a picture where it may lie tens of pixels off.",
                      "Argument: the image field would take a displaced object for a stain in finer ones.",
                      "Larger: far displacements are missed."};
  Rule<int> far_smoothing{"images.search.far_smoothing",
                          3,
                          "",
                          "Passes over the directions in these cells.",
                          "Not recorded.",
                          "Smaller: far displacements are missed."};
  Rule<int> coarse_cells{"images.search.coarse_cells",
                         1600,
                         "",
                         "Cells of a picture in the coarse search.",
                         "Argument: coarse cells see displacements of many pixels.",
                         "Larger: slower, and displacements are missed."};
  Rule<int> coarse_smoothing{"images.search.coarse_smoothing",
                             2,
                             "",
                             "Passes over the directions in these cells.",
                             "Not recorded.",
                             "Not measured."};
  Rule<int> coarse_photographs{"images.search.coarse_photographs",
                               15,
                               "",
                               "Photographs that far and coarse searches see.",
                               "Cost: the time of a search.",
                               "Larger: slower. Smaller: values are less sure."};
  Rule<int> fine_cells{"images.search.fine_cells",
                       12544,
                       "",
                       "Cells of a picture in the fine search and where values are taken from all pictures.",
                       "Not recorded.",
                       "Larger: slower."};
  Rule<int> fine_smoothing{"images.search.fine_smoothing",
                           1,
                           "",
                           "Passes over the directions in these cells.",
                           "Not recorded.",
                           "Not measured."};
  Rule<int> fine_photographs{"images.search.fine_photographs",
                             30,
                             "",
                             "Photographs that the fine search sees.",
                             "Cost: the time of a search.",
                             "Larger: slower. Smaller: small effects are missed."};
  Rule<int> polish_photographs{"images.search.polish_photographs",
                               100,
                               "",
                               "Photographs at most from which the explanation's values are taken.",
                               "Cost: the time of a fit.",
                               "Larger: slower. Smaller: values are less sure."};

  // The coarse search.
  Rule<double> far_sigma{
      "images.search.far_sigma",
      20,
      "sigma",
      "From this noise of coarse rows, over that of pixels, on a search in far_cells goes first.",
      "Sets: a focal length 8 % off gives 38, a principal point 30 of 224 px off 190, 15 of 112 px off 48.",
      "Larger: a displaced object is taken for a stain. Smaller: slower."};
  Rule<double> far_leaves{"images.search.far_leaves",
                          0.5,
                          "share",
                          "What that search has found counts where it leaves less than this of that noise.",
                          "Argument: otherwise it was no displacement.",
                          "Larger: what is no cause is begun with."};
  Rule<int> max_far_steps{
      "images.search.max_far_steps",
      3,
      "",
      "Steps of that search (engine::SearchRules::max_steps).",
      "Argument: displacements of several causes at once; what else is missing is found later.",
      "Larger: slower."};
  Rule<int> max_trial_steps{
      "images.search.max_trial_steps",
      2,
      "",
      "Steps on trial, of far and coarse searches (engine::SearchRules::max_trial_steps).",
      "Argument: exposure, optics and place may all be off; each alone hides what the others take.",
      "Larger: slower. Smaller: causes that hide each other are missed."};
  Rule<int> coarse_passes{"images.search.coarse_passes",
                          3,
                          "",
                          "Coarse searches, each at what the one before has found.",
                          "Cost: the time of a search.",
                          "Smaller: what moves contours far hides what else is missing."};
  Rule<int> anchor_passes{"images.search.anchor_passes",
                          5,
                          "",
                          "So often derivatives are taken anew where a value has come to.",
                          "Cost: a fit each.",
                          "Smaller: values stop where old derivatives no longer lead downwards."};
  Rule<double> anchor_stays{"images.search.anchor_stays",
                            1,
                            "standard errors",
                            "A fit that moves every value by less from its anchor is near enough.",
                            "Not recorded.",
                            "Smaller: more fits for nothing."};

  // The search itself.
  Rule<double> min_declared_share{"images.search.min_declared_share",
                                  0.1,
                                  "share",
                                  "engine::SearchRules::min_declared_share.",
                                  "Sets: gamma in the place of exposure has 0.02.",
                                  "Smaller: a confounded effect takes another's place."};
  Rule<double> rest_sigma{"images.search.rest_sigma",
                          3,
                          "sigma",
                          "engine::SearchRules::rest_sigma.",
                          "Sets: what nothing explains let every effect in beside all others.",
                          "Larger: effects enter that explain a rest by chance."};
  Rule<double> rest_gain{"images.search.rest_gain",
                         0.05,
                         "share",
                         "engine::SearchRules::rest_cv_gain.",
                         "Sets: as for rest_sigma.",
                         "Smaller: effects enter that explain a rest by chance."};
  Rule<int> max_refits{
      "images.search.max_refits",
      4,
      "",
      "engine::SearchRules::max_refits.",
      "Cost: a fit takes a second; where nothing explains the pictures these are most of a diagnosis.",
      "Larger: slower. Smaller: a candidate that is not first by its score is missed."};
  Rule<int> max_rare_refits{"images.search.max_rare_refits",
                            2,
                            "",
                            "engine::SearchRules::max_rare_refits.",
                            "Cost: as for max_refits.",
                            "Larger: slower."};
  Rule<size_t> min_tried_pictures{"images.search.min_tried_pictures",
                                  8,
                                  "",
                                  "With fewer pictures nothing is said of whether nothing is missing.",
                                  "Argument: pictures are what is independent and is turned over.",
                                  "Smaller: too few ways to turn them."};
  Rule<double> misfit_rows{
      "images.search.misfit_rows",
      1.1,
      "sigma",
      "Rows that are left so many times their noise count as a misfit.",
      "Not recorded.",
      "Smaller: what simulations differ by is a misfit. Larger: small rests are missed."};

  // Steps that go, and large steps beside a rest.
  Rule<double> large_share{"images.search.large_share",
                           0.6,
                           "share",
                           "Of the excess on unseen pictures, what a step beside a rest takes at least.",
                           "Sets: an exposure of 0.25 stops beside dirt had no step.",
                           "Smaller: a rest is explained by what is not there."};
  Rule<int> max_large_steps{"images.search.max_large_steps",
                            3,
                            "",
                            "Such steps, one after the other.",
                            "Cost: each needs fits without parts.",
                            "Larger: slower."};
  Rule<int> max_large_tried{"images.search.max_large_tried",
                            4,
                            "",
                            "Candidates that are fitted for each, the most evident first.",
                            "Cost: a fit each.",
                            "Larger: slower. Smaller: the one that takes most may be missed."};
  Rule<double> step_p{"images.search.step_p",
                      1e-4,
                      "probability",
                      "A step goes whose values the scatter between pictures makes with more than this.",
                      "Not recorded.",
                      "Larger: steps of single pictures stay. Smaller: small steps go."};
  Rule<double> faint{"images.search.faint",
                     0.1,
                     "sigma",
                     "A smaller image field goes.",
                     "Argument: simulation and noise are known to that; it is no dirt.",
                     "Smaller: a faint field takes what steps are judged by."};
  Rule<int> field_side{"images.search.field_side",
                       64,
                       "px",
                       "Side of the coarse picture over which the image field is measured.",
                       "Argument: its waves are longer than such a pixel.",
                       "Not measured."};
  Rule<double> near_choice{"images.search.near_choice",
                           0.1,
                           "",
                           "A value so near to one of an effect's choices is it; else the effect goes.",
                           "Argument: between two choices it is a mean of two.",
                           "Not measured."};

  // How good a model is.
  Rule<int> patches{"images.search.patches",
                    1600,
                    "",
                    "Patches of a picture for the p of a misfit.",
                    "Not recorded.",
                    "Larger: small misfits weigh less, local ones more."};
  Rule<double> variance_known{"images.search.variance_known",
                              1.05,
                              "",
                              "For that p the noise's variance may be so many times as large.",
                              "Not recorded.",
                              "Smaller: an error of the noise is a misfit."};
  Rule<double> min_repeat_pixels{"images.search.min_repeat_pixels",
                                 1000,
                                 "degrees of freedom",
                                 "From so many on repeats tell the noise floor; else neighbouring pixels do.",
                                 "Not recorded.",
                                 "Smaller: a floor that is hardly known counts."};
  Rule<double> contours{
      "images.search.contours",
      1.1,
      "sigma",
      "Up to this error over the floor contours alone may be the cause; beyond it is lack of fit.",
      "Sets: a wrong lens, 6 times the floor off at contours alone, was said to fit (p 1.00).",
      "Smaller: sampling is lack of fit. Larger: wrong lenses fit."};
  Rule<double> min_place_px2{"images.search.min_place_px2",
                             1e-4,
                             "px^2",
                             "Least variance of a contour's place.",
                             "Argument: simulations of one scene differ by that.",
                             "Smaller: contours are too sure."};
  Rule<double> held_out_near{"images.search.held_out_near",
                             0.3,
                             "standard errors",
                             "A value may be so far off in a fit without a part.",
                             "Cost: fewer steps of each fit.",
                             "Larger: the error on unseen pictures is too large."};
  Rule<double> pixel_dof_share{"images.search.pixel_dof_share",
                               0.3,
                               "degrees of freedom",
                               "What a pixel of the residuals' differences is worth.",
                               "Not recorded.",
                               "Larger: the noise floor is told too sure."};
};
inline constexpr PhotoSearchRules kPhotoSearchRules;

}  // namespace touchstone::diagnosis::images
