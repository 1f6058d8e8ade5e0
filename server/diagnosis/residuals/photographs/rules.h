// Numbers by which the residuals of photographs are described (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::residuals {

struct PhotographResidualRules {
  // Slices and curves.
  Rule<size_t> max_slices{"residuals.photographs.max_slices",
                          5,
                          "",
                          "Slices of photographs that are reported.",
                          "Display: what a reader can take in.",
                          "Larger: longer reports."};
  Rule<int> max_pixels{"residuals.photographs.max_pixels",
                       80000,
                       "",
                       "About so many pixels of all pictures slices are searched in.",
                       "Cost: the pixels times the pairs of covariates.",
                       "Larger: slower."};
  Rule<int> min_pixels_of_picture{"residuals.photographs.min_pixels_of_picture",
                                  60,
                                  "",
                                  "But so many of each picture.",
                                  "Not recorded.",
                                  "Smaller: pictures of large sets say nothing. Larger: slower."};
  Rule<double> certain_share{"residuals.photographs.certain_share",
                             0.03,
                             "share",
                             "Where the excess over the noise's squares is less no slice is looked for.",
                             "Not recorded.",
                             "Smaller: slices that chance makes."};
  Rule<size_t> min_slice_poses{"residuals.photographs.min_slice_poses",
                               3,
                               "",
                               "So many poses a slice has in the other half, or it shows nothing.",
                               "Not recorded.",
                               "Smaller: the scatter of poses is hardly known."};
  Rule<int> sampled_pixels{"residuals.photographs.sampled_pixels",
                           4000,
                           "",
                           "Pixels of each picture that place the bins of a curve.",
                           "Cost: they are sorted.",
                           "Larger: slower."};
  Rule<size_t> min_independent{"residuals.photographs.min_independent",
                               6,
                               "",
                               "Fewer poses, or pictures of a session, are not tested: p is 1.",
                               "Not recorded.",
                               "Smaller: too few signs to exchange."};

  // Outlines.
  Rule<double> outline_px{"residuals.photographs.outline_px",
                          2.5,
                          "px",
                          "A pixel so near to the expected outline belongs to it, not to object or ground.",
                          "Not recorded.",
                          "Smaller: errors of contours count as the object's."};
  Rule<double> clear_of_object_px{"residuals.photographs.clear_of_object_px",
                                  5,
                                  "px",
                                  "From so far outside of the expected object on a pixel is background.",
                                  "Argument: whatever is a little off.",
                                  "Smaller: a displaced object counts as background."};
  Rule<double> min_background{"residuals.photographs.min_background",
                              0.02,
                              "share",
                              "Of the picture; with less background the silhouette is not known.",
                              "Not recorded.",
                              "Smaller: a few pixels tell what stands out."};
  Rule<double> stand_out_sigmas{"residuals.photographs.stand_out_sigmas",
                                5,
                                "sigma",
                                "Of the background's scatter: what differs from it by more is the object.",
                                "Not recorded.",
                                "Smaller: noise of the background is object."};
  Rule<double> min_stand_out{
      "residuals.photographs.min_stand_out",
      6,
      "grey levels",
      "And by more than this.",
      "Not recorded.",
      "Smaller: shades of the background are object. Larger: dark parts are background."};
  Rule<double> min_piece{"residuals.photographs.min_piece",
                         0.02,
                         "share",
                         "A smaller connected piece, over the expected object's pixels, is no object.",
                         "Argument: it is dirt.",
                         "Smaller: dirt is object."};

  // Maps.
  Rule<size_t> worst_maps{"residuals.photographs.worst_maps",
                          3,
                          "",
                          "Pictures of largest error that are shown, besides one of middling error.",
                          "Cost: the size of the report.",
                          "Larger: larger reports."};
};
inline constexpr PhotographResidualRules kPhotographResidualRules;

}  // namespace touchstone::diagnosis::residuals
