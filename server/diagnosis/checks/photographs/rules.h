// Numbers by which mistakes of image sets are tried and claimed (server/diagnosis/RULES.md lists all rooms). What is "left" of a
// picture is the share of its variation that the expected picture does not explain (photo_trial.h).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::checks {

struct PhotoCheckRules {
  // Of the trials; the share of the pictures that counts is kCheckRules.counted_share.
  Rule<int> small_side{"checks.photographs.small_side",
                       64,
                       "px",
                       "The longer side of a picture shrinks to about this before it is compared.",
                       "Cost: a hundred trials take seconds.",
                       "Larger: slower. Smaller: outlines blur."};
  Rule<size_t> max_small{"checks.photographs.max_small",
                         600,
                         "",
                         "So many pictures of a set, the first ones, are made smaller and looked at.",
                         "Cost: memory and time.",
                         "Smaller: odd pictures beyond are missed."};
  Rule<int> max_compared{"checks.photographs.max_compared",
                         30,
                         "",
                         "About so many pictures are compared in each trial, as many of every object.",
                         "Cost: a hundred trials take seconds.",
                         "Larger: slower."};

  // Of a whole set.
  Rule<size_t> min_pictures{"checks.photographs.min_pictures",
                            6,
                            "",
                            "Fewer compared pictures say nothing of a mistake of the whole set.",
                            "Not recorded.",
                            "Smaller: few pictures blame the set."};
  Rule<size_t> min_of_object{"checks.photographs.min_of_object",
                             3,
                             "",
                             "Fewer pictures of an object say nothing of its name or mesh.",
                             "Not recorded.",
                             "Smaller: names are changed for two pictures."};
  Rule<double> min_left{"checks.photographs.min_left",
                        0.04,
                        "share",
                        "Where less is left no mistake is claimed.",
                        "Not recorded.",
                        "Smaller: pictures that fit are blamed. Larger: mistakes that do little are missed."};
  Rule<double> max_ratio{
      "checks.photographs.max_ratio",
      0.4,
      "share",
      "A fix that leaves more than this of what was left before is not claimed.",
      "Argument: missing physics would have to equal the mistake in every picture at once.",
      "Larger: missing physics is called a mistake. Smaller: mistakes beside it are missed."};
  Rule<double> max_left{"checks.photographs.max_left",
                        0.3,
                        "share",
                        "What a fix leaves at most.",
                        "Not recorded.",
                        "Larger: fixes that explain little are claimed."};
  Rule<double> min_agreement{"checks.photographs.min_agreement",
                             0.75,
                             "share",
                             "So many of the pictures must fit better with the fix.",
                             "Argument: a mistake of the set is one of most pictures.",
                             "Not measured."};
  Rule<double> alike{"checks.photographs.alike",
                     1.6,
                     "",
                     "Other mistakes of the set that leave at most so many times as much are named beside.",
                     "Argument: some make the same set (turned by 180 deg; up reversed).",
                     "Smaller: one of equals is claimed. Larger: too many are named."};

  // Of single pictures.
  Rule<size_t> min_all{
      "checks.photographs.min_all",          8, "", "Fewer pictures do not say what is odd.", "Not recorded.",
      "Smaller: the median is hardly known."};
  Rule<double> max_median{"checks.photographs.max_median",
                          0.1,
                          "share",
                          "Where more is left of the median picture none is called odd.",
                          "Argument: the model must explain the others.",
                          "Larger: physics makes odd pictures."};
  Rule<double> min_odd_left{"checks.photographs.min_odd_left",
                            0.12,
                            "share",
                            "A picture of which less is left is not odd.",
                            "Not recorded.",
                            "Smaller: pictures that fit are blamed."};
  Rule<double> min_odd_ratio{"checks.photographs.min_odd_ratio",
                             8,
                             "",
                             "Nor one of which less than so many times the median's is left.",
                             "Not recorded.",
                             "Smaller: pictures that fit badly are blamed."};
  Rule<double> max_stale_share{"checks.photographs.max_stale_share",
                               0.4,
                               "share",
                               "Where more of the pictures are odd nothing is said of them.",
                               "Argument: the others say what is odd.",
                               "Larger: a wrong model makes odd ones."};
  Rule<double> max_odd_share{"checks.photographs.max_odd_share",
                             0.1,
                             "share",
                             "So many may be odd but for views of the row before; two may be in any case.",
                             "Not recorded.",
                             "Larger: a wrong model makes odd pictures. Smaller: few odd ones are missed."};
  Rule<double> fixed_ratio{"checks.photographs.fixed_ratio",
                           0.3,
                           "share",
                           "A picture is fixed where this of what was left of it is left.",
                           "Not recorded.",
                           "Larger: fixes that help by chance are claimed."};
  Rule<double> like_others{"checks.photographs.like_others",
                           3,
                           "",
                           "Or where so many times the median's is left.",
                           "Argument: it is then as good as the others.",
                           "Not measured."};
  Rule<int> max_stale_rows{"checks.photographs.max_stale_rows",
                           3,
                           "",
                           "So many rows back the view is looked for that an old picture shows.",
                           "Not recorded.",
                           "Larger: more trials."};

  // Red and blue exchanged in a part of the pictures.
  Rule<int> dark{"checks.photographs.dark",
                 24,
                 "grey levels",
                 "A pixel with a darker channel does not tell its colour.",
                 "Not recorded.",
                 "Smaller: noise makes colours."};
  Rule<int> bright{"checks.photographs.bright",
                   250,
                   "grey levels",
                   "A pixel with a brighter channel does not tell its colour.",
                   "Argument: clipped channels have lost their colour.",
                   "Larger: clipped pixels count."};
  Rule<int> min_pixels{"checks.photographs.min_pixels",
                       50,
                       "",
                       "A picture with fewer pixels that tell a colour has none.",
                       "Not recorded.",
                       "Smaller: few pixels choose the order."};
  Rule<double> min_tint{"checks.photographs.min_tint",
                        0.05,
                        "",
                        "Mean log(red / blue) of a picture of one order from which it is a colour.",
                        "Not recorded.",
                        "Smaller: grey pictures are told apart by noise."};
  Rule<double> max_tint_spread{"checks.photographs.max_tint_spread",
                               0.5,
                               "",
                               "The tints of one order scatter by at most this, relative to their mean.",
                               "Argument: the same colour seen the other way round, not two colours.",
                               "Larger: scenes of two colours are told."};
  Rule<int> min_pictures_of_order{"checks.photographs.min_pictures_of_order",
                                  2,
                                  "",
                                  "So many pictures of either order, or nothing is said.",
                                  "Not recorded.",
                                  "Smaller: one picture of another colour is told."};
  Rule<size_t> max_ranges{"checks.photographs.max_ranges",
                          24,
                          "",
                          "Where the wrong pictures are more ranges nothing is said.",
                          "Display: what a command can list.",
                          "Larger: longer commands."};
};
inline constexpr PhotoCheckRules kPhotoCheckRules;

}  // namespace touchstone::diagnosis::checks
