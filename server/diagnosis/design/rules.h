// Numbers by which further measurements are predicted, proposed and counted.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::design {

struct DesignRules {
  Rule<double> verdict_nats{
      "design.verdict_nats",
      6,
      "nats",
      "Expected log evidence between two models at which they count as told apart.",
      "Not recorded.",
      "Smaller: too few measurements are proposed for a verdict. Larger: more than it needs."};
  Rule<int> max_to_verdict{
      "design.max_to_verdict",        100000,         "", "Measurements until a verdict: more are not named.",
      "Display: more are no advice.", "Not measured."};
  Rule<double> curvature_share{
      "design.curvature_share",
      1e-3,
      "share",
      "Of the square of a difference: a fitted rival that leaves less of it is no other model.",
      "Argument: the prediction is linear, and curvature leaves as much.",
      "Not measured."};
  Rule<double> negligible_prior{"design.negligible_prior",
                                1e-9,
                                "",
                                "Weight of the prior of values, in units of scaled information.",
                                "Argument: values that no candidate sees stay.",
                                "Not measured."};
  Rule<double> max_derivative_sigmas{
      "design.max_derivative_sigmas",
      200,
      "sigma",
      "A touch whose time moves more with one derivative step says nothing of that value.",
      "Argument: it is a finger that slips off a face.",
      "Larger: touches at edges are proposed for what they seem to show."};
  Rule<int> max_present{"design.max_present",
                        3000,
                        "",
                        "Touches that stand for the present data.",
                        "Cost: each is predicted under every model and value.",
                        "Not measured."};
  Rule<int> run_length{"design.run_length",
                       50,
                       "",
                       "They are taken in runs of so many.",
                       "Argument: the previous touch still acts on the next.",
                       "Not measured."};
  Rule<double> spread{"design.spread", 0.8,
                      "share",         "Of each face: candidate touches lie within it.",
                      "Not recorded.", "Not measured."};
  Rule<double> near_edge_m{
      "design.near_edge_m",
      0.001,
      "m",
      "A candidate is moved so far to four sides; where normal or travel jump, it is near an edge and left "
      "out.",
      "Not recorded.",
      "Smaller: touches are proposed that a small error of the pose spoils. Larger: small faces get none."};
  Rule<double> max_turn_of_normal_deg{"design.max_turn_of_normal_deg",
                                      15,
                                      "deg",
                                      "Turn of the normal over that distance that is no edge.",
                                      "Not recorded.",
                                      "Not measured."};
  Rule<double> min_photo_separation{
      "design.min_photo_separation",
      4,
      "sigma",
      "Squared, in all: no photograph is proposed that separates models less.",
      "Argument: contours are sampled at pixel centres, which alone makes some.",
      "Not measured."};
  Rule<int> max_views{"design.max_views",
                      180,
                      "",
                      "Candidate views of all objects.",
                      "Cost: each is rendered under every model and value.",
                      "Not measured."};
  Rule<int> max_present_photographs{"design.max_present_photographs",
                                    30,
                                    "",
                                    "Photographs that stand for the present data.",
                                    "Cost: each is rendered under every model and value.",
                                    "Not measured."};
  Rule<int> cells{"design.cells",  1600,           "", "Cells of a predicted picture, about.",
                  "Not recorded.", "Not measured."};
  Rule<int> max_side_px{
      "design.max_side_px",
      224,
      "px",
      "Longer side of predicted pictures; larger ones are made smaller, with as much noise per angle.",
      "Cost: rendering.",
      "Smaller: contours are coarse."};
  Rule<double> ray_steps{"design.ray_steps",
                         1,
                         "",
                         "Derivative steps to both sides of values that move contours, over their scale.",
                         "Argument: contours must move by more than their grain.",
                         "Smaller: derivatives show which pixels flip. Larger: curvature."};
  Rule<double> sensor_steps{
      "design.sensor_steps", 0.25,           "", "... of values that change grey levels only.",
      "Not recorded.",       "Not measured."};
  Rule<double> span_tolerance{
      "design.span_tolerance",
      1e-4,
      "share",
      "Of a direction's squared length: one of which the others leave less out is one of theirs.",
      "Not recorded.",
      "Not measured."};
  Rule<double> min_shown_share{
      "design.min_shown_share",
      0.003,
      "share",
      "Of the pixels: a photograph in which the object covers no more is not proposed.",
      "Not recorded.",
      "Not measured."};
  Rule<double> min_sigma_grey{"design.min_sigma_grey",
                              0.3,
                              "grey levels",
                              "Noise of a pixel that predictions assume at least.",
                              "Argument: rounding to 8 bits.",
                              "Not measured."};
  Rule<double> highest_sine{
      "design.highest_sine", 0.94,           "", "Sine of the elevation of the highest candidate view.",
      "Not recorded.",       "Not measured."};
  Rule<double> lowest_sine{
      "design.lowest_sine", -0.6,           "", "... of the lowest, where there is no table.",
      "Not recorded.",      "Not measured."};
  Rule<double> lowest_over_table_deg{"design.lowest_over_table_deg",
                                     5,
                                     "deg",
                                     "... and its elevation over a table.",
                                     "Not recorded.",
                                     "Not measured."};
  Rule<double> picture_margin{"design.picture_margin",
                              0.03,
                              "share",
                              "Of the picture: margin that a view leaves around the object.",
                              "Not recorded.",
                              "Not measured."};
  Rule<double> towards_rim{"design.towards_rim",
                           0.8,
                           "share",
                           "Of the free way to the picture's rim, by which views look past the object.",
                           "Not recorded.",
                           "Not measured."};
  Rule<double> min_clearance{
      "design.min_clearance",
      1.2,
      "",
      "Radii of the object's sphere by which the camera stands away from its centre at least.",
      "Not recorded.",
      "Not measured."};
  Rule<int> max_tries{"design.max_tries",
                      6,
                      "",
                      "Views that are drawn per view that is wanted.",
                      "Cost: bounds the drawing where few views are allowed.",
                      "Not measured."};
};
inline constexpr DesignRules kDesignRules;

}  // namespace touchstone::diagnosis::design
