// Numbers by which pixels, their noise and contours are read (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::images {

struct PixelRules {
  // Cells and contours.
  Rule<double> contour_step_grey{"images.pixels.contour_step_grey",
                                 4,
                                 "grey levels",
                                 "What neighbouring pixels differ by beyond this is a contour.",
                                 "Not recorded.",
                                 "Smaller: noise and shading become contours."};
  Rule<double> clipped_sigmas{
      "images.pixels.clipped_sigmas",
      15,
      "sigma",
      "A pixel that is always clipped counts as if it scattered so much.",
      "Argument: its mean is as good as what is known of its noise there.",
      "Smaller: an error of the noise is fitted by light. Larger: clipped pixels say nothing."};

  // The nameless image field.
  Rule<double> field_typical_grey{"images.pixels.field_typical_grey",
                                  5,
                                  "grey levels",
                                  "Typical size of each wave of the image field: its prior.",
                                  "Not recorded.",
                                  "Changes what the field costs against effects with a name."};
  Rule<double> field_max_grey{"images.pixels.field_max_grey",
                              200,
                              "grey levels",
                              "Bound of each wave of the image field.",
                              "Not recorded.",
                              "Smaller: strong dirt is cut."};

  // The noise of single pixels.
  Rule<int> level_bins{"images.pixels.level_bins",
                       16,
                       "",
                       "Into so many bins of grey levels the scatter of pixels is gathered.",
                       "Not recorded.",
                       "Larger: fewer differences in each."};
  Rule<double> difference_step_grey{"images.pixels.difference_step_grey",
                                    0.125,
                                    "grey levels",
                                    "Width of a step of the histogram of second differences.",
                                    "Not recorded.",
                                    "Larger: small noise is read coarsely."};
  Rule<int> difference_steps{"images.pixels.difference_steps",
                             400,
                             "",
                             "Steps of that histogram; larger differences are in its last.",
                             "Not recorded.",
                             "Smaller: strong noise is in the last step."};
  Rule<double> kept_share{"images.pixels.kept_share",
                          0.8,
                          "share",
                          "The smallest of the differences that tell the noise. kKeptVariance is the "
                          "variance of these and must follow.",
                          "Argument: edges and texture take no part where they are fewer.",
                          "Larger: edges count as noise. Smaller: the noise is known less well."};
  Rule<double> min_count{"images.pixels.min_count",
                         200,
                         "",
                         "A bin of fewer differences has no scatter.",
                         "Not recorded.",
                         "Smaller: scatters that are hardly known count."};
  Rule<double> clipped_bin{
      "images.pixels.clipped_bin",
      5,
      "sigma",
      "A bin whose levels lie so far from black and white is not cut; others count only where none is.",
      "Argument: what is cut at black or white scatters too little.",
      "Smaller: cut scatter bounds the noise from below (1.62 where 2.02 was simulated)."};
  Rule<double> clipped_from{"images.pixels.clipped_from",
                            4,
                            "sigma",
                            "Farther from black and white a pixel's mean record is its grey level.",
                            "Argument: chance cuts one record in 30,000 there.",
                            "Larger: slower."};
  Rule<double> no_tail{"images.pixels.no_tail",
                       1e-12,
                       "probability",
                       "Levels that a clipped pixel reaches less often are left out of its mean.",
                       "Cost: the sum over levels ends there.",
                       "Larger: means near black are too low."};
  Rule<double> trimmed_efficiency{
      "images.pixels.trimmed_efficiency",
      0.35,
      "degrees of freedom",
      "What one difference is worth: it is trimmed and shares pixels with others.",
      "Not recorded.",
      "Larger: errors of the noise are told too small."};
};
inline constexpr PixelRules kPixelRules;

}  // namespace touchstone::diagnosis::images
