// Numbers by which pictures of a board are read, fitted and judged.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::boards {

struct BoardRules {
  Rule<int> min_pictures{"boards.min_pictures", 5, "", "Pictures that a verdict needs.", "Not recorded.",
                         "Not measured."};
  Rule<double> min_gain_nats{
      "boards.min_gain_nats",
      3,
      "nats",
      "Gain in log evidence that an effect needs, and by which two must differ not to be equivalent.",
      "Not recorded.",
      "Smaller: effects by chance. Larger: a weak distortion is missed."};
  Rule<int> min_orientations{"boards.min_orientations",
                             3,
                             "",
                             "Orientations of the board before the camera that a verdict needs.",
                             "Argument: each gives two conditions on fx, fy, cx and cy (Zhang 2000); a turn "
                             "in its plane gives none.",
                             "Smaller: one picture six times gave k1 +- 2.6e-8."};
  Rule<double> min_tilt_apart_deg{"boards.min_tilt_apart_deg",
                                  5,
                                  "deg",
                                  "Angle between the board's normals of two orientations, at least.",
                                  "Not recorded.",
                                  "Not measured."};
  Rule<double> copy_px{
      "boards.copy_px",
      1e-3,
      "px",
      "Pictures none of whose corners differ by as much are one.",
      "Argument: corners of two pictures that were taken scatter by a hundredth of a pixel or more.",
      "Larger: true repeats count once. Smaller: copies that were written anew count twice."};
  Rule<double> floor_px{"boards.floor_px",
                        1e-3,
                        "px",
                        "Least error of a corner in the likelihood.",
                        "Argument: corners that are met exactly (made up ones) have no likelihood otherwise.",
                        "Not measured."};
  Rule<size_t> max_pictures{"boards.max_pictures",
                            1000,
                            "",
                            "Pictures of a folder at most; more are refused.",
                            "Cost: each is decoded and searched.",
                            "Not measured."};
  Rule<int> max_side_px{"boards.max_side_px",
                        16384,
                        "px",
                        "Longer side of a picture; larger ones are refused.",
                        "Cost: memory of a decoded picture.",
                        "Not measured."};
  Rule<double> window_share{
      "boards.window_share",
      0.35,
      "share",
      "Of the way to the next corner: half a side of the window in which a corner is refined.",
      "Argument: another edge would draw it away.",
      "Larger: corners are off. Smaller: they scatter more."};
  Rule<int> min_window_px{"boards.min_window_px", 3, "px", "... at least.", "Not recorded.", "Not measured."};
  Rule<int> max_window_px{"boards.max_window_px", 11, "px", "... at most.", "Not recorded.", "Not measured."};
  Rule<int> max_iterations{"boards.max_iterations",
                           200,
                           "",
                           "Steps of Levenberg and Marquardt to a picture's pose.",
                           "Cost: bounds poses that do not converge.",
                           "Not measured."};
  Rule<double> converged{"boards.converged",
                         1e-9,
                         "share",
                         "Of the sum of squares: a step after which it falls by no more ends the pose's fit.",
                         "Not recorded.",
                         "Not measured."};
  Rule<double> max_damping{"boards.max_damping",
                           1e12,
                           "",
                           "Damping beyond which no step is tried.",
                           "Not recorded.",
                           "At 1e12 a step vanishes beside rounding of a pose."};
};
inline constexpr BoardRules kBoardRules;

}  // namespace touchstone::diagnosis::boards
