// Numbers of what a report shows of the residuals of touches (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::residuals {

struct TouchResidualRules {
  // One finger that scatters more or less than the others.
  Rule<double> min_finger_difference{"residuals.touches.min_finger_difference",
                                     1.0 / 6,
                                     "share",
                                     "A finger whose error differs by less from the others' is not named.",
                                     "Not recorded.",
                                     "Smaller: differences that do not matter are told."};
  Rule<double> max_finger_p{
      "residuals.touches.max_finger_p",
      1e-3,
      "probability",
      "Nor one of which chance does as much with more than this, every finger paid for.",
      "Not recorded.",
      "Larger: chance is told."};
  Rule<int> min_finger_poses{"residuals.touches.min_finger_poses",
                             20,
                             "",
                             "Fewer poses are not compared.",
                             "Argument: below it a mean of squares is no normal variable.",
                             "Smaller: heavy tails are told."};

  // Groups.
  Rule<int> time_bins{"residuals.touches.time_bins",
                      8,
                      "",
                      "Parts of the session, of equal length.",
                      "Display: what a table can show.",
                      "Larger: longer tables."};
  Rule<size_t> max_groups{"residuals.touches.max_groups",
                          200,
                          "",
                          "A kind of more groups (faces, rounds, speeds) is left out.",
                          "Display: what a table can show.",
                          "Larger: longer tables."};

  // Tables and pictures.
  Rule<size_t> max_worst{"residuals.touches.max_worst",
                         10,
                         "",
                         "Touches that the model predicts worst, that are shown.",
                         "Display: what a reader can take in.",
                         "Larger: longer reports."};
  Rule<int> max_table_touches{"residuals.touches.max_table_touches",
                              4000,
                              "",
                              "About so many touches the table of a page holds, whole poses.",
                              "Cost: the size of the report.",
                              "Larger: larger reports."};
  Rule<int> max_surface_points{"residuals.touches.max_surface_points",
                               4000,
                               "",
                               "Points on the surfaces of all objects.",
                               "Cost: the size of the report.",
                               "Larger: larger reports."};
  Rule<int> max_object_points{"residuals.touches.max_object_points",
                              1500,
                              "",
                              "And of one object.",
                              "Display: what a picture can show.",
                              "Larger: larger reports."};
  Rule<int> outline_triangles{"residuals.touches.outline_triangles",
                              400,
                              "",
                              "Triangles of the coarse copy of a mesh that is drawn.",
                              "Cost: the size of the report.",
                              "Larger: larger reports."};
};
inline constexpr TouchResidualRules kTouchResidualRules;

}  // namespace touchstone::diagnosis::residuals
