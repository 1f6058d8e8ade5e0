// Numbers by which rows of photographs are made, and what they leave is described (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::images {

struct PhotoRowRules {
  // Rows of one picture.
  Rule<double> ray_step{"images.rows.ray_step",
                        0.3,
                        "",
                        "Step of a derivative by what moves rays, over the parameter's typical size.",
                        "Not recorded.",
                        "Larger: the change is no longer proportional to the step."};
  Rule<double> sensor_step{
      "images.rows.sensor_step", 0.5, "", "The same by what moves no rays.", "Not recorded.",
      "Larger: as for ray_step."};
  Rule<double> step_px{"images.rows.step_px",
                       0.5,
                       "px",
                       "A step that moves contours farther is made shorter.",
                       "Argument: contours stay among the pixels near contours.",
                       "Larger: displaced contours leave the pixels whose change is followed."};
  Rule<int> around_px{"images.rows.around_px",
                      6,
                      "px",
                      "So far beyond the object's outline its displacement is continued.",
                      "Argument: blurred contours reach that far.",
                      "Smaller: wide blur is not moved."};
  Rule<double> span_tolerance{"images.rows.span_tolerance",
                              1e-4,
                              "share",
                              "Directions of less of their squared length beyond others are left out.",
                              "Not recorded.",
                              "Larger: effects that look nearly alike share a row."};
  Rule<int> object_waves{"images.rows.object_waves",
                         2,
                         "",
                         "Waves of nameless light over the object, across and down.",
                         "Not recorded.",
                         "Larger: more rows."};
  Rule<int> patch_px{"images.rows.patch_px",
                     12,
                     "px",
                     "Side of a patch of the surface where a smooth error of the albedo enters.",
                     "Not recorded.",
                     "Smaller: more sites, slower."};
  Rule<double> min_patch_share{"images.rows.min_patch_share",
                               0.25,
                               "share",
                               "A patch of which fewer pixels see the object is left out.",
                               "Not recorded.",
                               "Smaller: patches at the outline count."};
  Rule<int> max_run{"images.rows.max_run",
                    64,
                    "",
                    "So many cells at most are summed in single precision.",
                    "Argument: longer sums lose digits.",
                    "Larger: less exact. Smaller: slower."};
  Rule<double> far_rows{"images.rows.far_rows",
                        1e3,
                        "sigma",
                        "So far from what was measured is what cannot be simulated.",
                        "Argument: it is far from everything that was measured.",
                        "Smaller: fits may end where nothing is seen."};

  // What is left over covariates.
  Rule<int> curve_bins{"images.rows.curve_bins",
                       10,
                       "",
                       "Bins of a residual over a covariate.",
                       "Not recorded.",
                       "Larger: fewer pixels in each, more tests."};
  Rule<double> min_bin_share{"images.rows.min_bin_share",
                             1e-3,
                             "share",
                             "A bin of fewer of the pixels is left out.",
                             "Not recorded.",
                             "Smaller: a few odd pixels make a curve."};
  Rule<double> max_clipped_share{
      "images.rows.max_clipped_share",
      0.001,
      "share",
      "Pixels of which more records are clipped take no part in curves and in uneven noise.",
      "Not recorded.",
      "Larger: what is cut looks like light, or like less noise."};

  // Kinds of what is left.
  Rule<double> min_kind_share{"images.rows.min_kind_share",
                              0.15,
                              "share",
                              "A kind that takes less of the excess error is not told.",
                              "Not recorded.",
                              "Smaller: kinds that say little are told."};
  Rule<double> min_cause_share{"images.rows.min_cause_share",
                               0.5,
                               "share",
                               "Only a kind that takes so much of the excess has its cause named.",
                               "Argument: causes in words were named of kinds that took a sixth.",
                               "Smaller: wrong causes are named."};
  Rule<double> max_few_share{"images.rows.max_few_share",
                             0.1,
                             "share",
                             "At most so many of the pictures are a few.",
                             "Not recorded.",
                             "Larger: half of the set is a few pictures."};
  Rule<double> min_few_share{"images.rows.min_few_share",
                             0.5,
                             "share",
                             "A few pictures are told where they hold so much of the excess.",
                             "Not recorded.",
                             "Smaller: the largest errors of any set are told."};
  Rule<double> min_object_share{"images.rows.min_object_share",
                                0.7,
                                "share",
                                "One object is told where its pictures hold so much of the excess.",
                                "Not recorded.",
                                "Smaller: an object among several wrong ones is told."};
  Rule<double> min_object_ratio{"images.rows.min_object_ratio",
                                2,
                                "",
                                "And so many times their share of the pictures.",
                                "Not recorded.",
                                "Not measured."};
  Rule<double> shutter_share{"images.rows.shutter_share",
                             0.5,
                             "share",
                             "A displacement that grows by so much from row to row is a shutter's.",
                             "Not recorded.",
                             "Smaller: poses that are off are called a shutter."};
  Rule<int> block_px{"images.rows.block_px",
                     16,
                     "px",
                     "Side of the blocks of a picture of which every other one is held out.",
                     "Not recorded.",
                     "Smaller: neighbouring blocks share their errors."};
  Rule<int> map_cells{"images.rows.map_cells",
                      14,
                      "",
                      "Cells along a side of a picture, for grey levels at the same places of every picture.",
                      "Not recorded.",
                      "Larger: finer stains, fewer pixels in each."};
  Rule<double> shrinkage_px{"images.rows.shrinkage_px",
                            20,
                            "",
                            "Pixels' worth of a prior at no change, of a cell.",
                            "Not recorded.",
                            "Smaller: cells of few pixels follow their noise."};

  // Stuck pixels.
  Rule<double> same_sigmas{"images.rows.same_sigmas",
                           8,
                           "sigma",
                           "A pixel whose levels differ by at most this always shows the same.",
                           "Not recorded.",
                           "Smaller: hot pixels with noise are missed."};
  Rule<double> apart_sigmas{"images.rows.apart_sigmas",
                            8,
                            "sigma",
                            "It stands out where it differs by more from its neighbours and the model.",
                            "Not recorded.",
                            "Smaller: texture is told as stuck pixels."};
  Rule<int> min_apart_poses{"images.rows.min_apart_poses",
                            5,
                            "",
                            "In so many poses it must stand out.",
                            "Not recorded.",
                            "Smaller: a speck on an object is told as the camera's."};
  Rule<size_t> places_shown{"images.rows.places_shown",
                            4,
                            "",
                            "Places of stuck pixels in a sentence.",
                            "Display: what a sentence can hold.",
                            "Larger: longer sentences."};

  // Noise that differs between parts.
  Rule<double> contour_grey{"images.rows.contour_grey",
                            20,
                            "grey levels",
                            "Pixels at a larger step of the expected picture take no part.",
                            "Argument: smaller ones are the shade of a curved surface.",
                            "Larger: misplaced contours look like noise."};
  Rule<double> min_part_dof{"images.rows.min_part_dof",
                            200,
                            "degrees of freedom",
                            "A part of fewer takes no part.",
                            "Not recorded.",
                            "Smaller: parts whose scatter is hardly known are told."};
  Rule<size_t> parts_shown{"images.rows.parts_shown",
                           6,
                           "",
                           "Of more parts only the least and the most noisy are named.",
                           "Display: what a sentence can hold.",
                           "Larger: longer sentences."};
};
inline constexpr PhotoRowRules kPhotoRowRules;

}  // namespace touchstone::diagnosis::images
