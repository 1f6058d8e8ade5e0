// Numbers by which the course of a session is asked (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::selection {

struct SessionRules {
  Rule<double> min_gain{
      "selection.session.min_gain",
      10,
      "nats",
      "What turns, or an object that moves, must gain over none; what was tried is paid for besides.",
      "Not recorded.",
      "Smaller: chance makes turns and motions. Larger: weak ones pass as noise."};
  Rule<double> min_repeated_share{
      "selection.session.min_repeated_share",
      0.25,
      "share",
      "With more repeats among the touches these alone tell, and no misfit enters.",
      "Not recorded.",
      "Smaller: few repeats decide. Larger: a misfit decides though there are repeats."};
  Rule<int> max_rounds{"selection.session.max_rounds",
                       40,
                       "",
                       "Of more rounds none is tried, as a part of the session or as a pose of the object.",
                       "Cost: values of each round. At most 63, the bits of a set of rounds.",
                       "Smaller: long sessions show no rounds. Larger: slower, and each part pays more."};
  Rule<size_t> max_rounds_in_every_set{
      "selection.session.max_rounds_in_every_set",
      6,
      "",
      "Up to so many rounds every set of them is a part that is tried.",
      "Cost: half of 2^rounds sets, which are paid for.",
      "Smaller: two of six rounds are no part. Larger: each part pays more."};
  Rule<int> stretches{"selection.session.stretches",
                      20,
                      "",
                      "Parts that are stretches begin and end at so many even places of the session.",
                      "Cost: pairs of places, which are paid for. The number is not recorded.",
                      "Smaller: short stretches are missed. Larger: each part pays more."};
  Rule<int> min_offset_touches{"selection.session.min_offset_touches",
                               60,
                               "",
                               "With fewer touches of all fingers no offset of some touches is looked for.",
                               "Not recorded.",
                               "Smaller: few touches decide. Larger: small sets show no such offset."};
  Rule<int> offset_steps{"selection.session.offset_steps",
                         80,
                         "",
                         "Steps of the expectation-maximisation of two groups of touches.",
                         "Cost: bounds time. The number is not recorded.",
                         "Smaller: values have not converged. Larger: time for nothing."};
  Rule<double> min_offset_share{"selection.session.min_offset_share",
                                0.04,
                                "share",
                                "An offset of fewer touches is none.",
                                "Argument: fewer are outliers. The number is not recorded.",
                                "Smaller: outliers are an offset. Larger: a rare offset passes as outliers."};
  Rule<double> offset{"selection.session.offset",
                      12,
                      "nats",
                      "What two groups must gain over each single distribution.",
                      "Not recorded.",
                      "Smaller: heavy tails are two groups. Larger: weak offsets pass as noise."};
  Rule<double> min_separation{
      "selection.session.min_separation",
      2,
      "sigma",
      "The least distance of the groups over their scatter.",
      "Argument: ticks alone look like two groups that overlap. The number is not recorded.",
      "Smaller: ticks are two groups. Larger: weak offsets pass as noise."};
  Rule<double> max_autocorrelation{
      "selection.session.max_autocorrelation",
      0.25,
      "",
      "Where neighbours in the session agree more in who has the offset, the time says who.",
      "Not recorded.",
      "Smaller: chance speaks for time. Larger: a stretch is an offset at random."};
  Rule<double> min_within_poses{
      "selection.session.min_within_poses",
      0.6,
      "share",
      "Where less of the variance of who has it lies within poses, the pose says who.",
      "Not recorded.",
      "Smaller: a misfit of some poses is an offset at random. Larger: chance speaks for the pose."};
  Rule<double> no_tails{"selection.session.no_tails",
                        1e3,
                        "degrees of freedom",
                        "Tails of Student's distribution are tried up to here.",
                        "Argument: beyond it is a normal distribution.",
                        "Smaller: light tails are not tried. Larger: time for nothing."};
  Rule<int> longest_turn{"selection.session.longest_turn",
                         8,
                         "",
                         "Turns of up to so many touches are tried.",
                         "Not recorded.",
                         "Smaller: longer turns are missed. Larger: each turn pays more."};
  Rule<int> min_units_of_place{"selection.session.min_units_of_place",
                               8,
                               "",
                               "With fewer readings at a place in the turn, the turn is not tried.",
                               "Not recorded.",
                               "Smaller: few readings decide. Larger: long turns of small sets are missed."};
  Rule<double> time_p{"selection.session.time_p",
                      1e-4,
                      "probability",
                      "A course in time that repeats share is real if chance gives it less often.",
                      "Not recorded.",
                      "Smaller: weak courses pass as noise. Larger: chance makes courses."};
  Rule<double> negligible_time{
      "selection.session.negligible_time",
      0.02,
      "share",
      "A course that makes less of the floor is negligible.",
      "Not recorded.",
      "Smaller: large sets tell of what nobody sees. Larger: courses pass as noise."};
  Rule<int> min_neighbours{"selection.session.min_neighbours",
                           20,
                           "",
                           "With fewer neighbours in time no course is asked for.",
                           "Not recorded.",
                           "Smaller: few touches decide. Larger: small sets show no course."};
  Rule<int> max_time_permutations{
      "selection.session.max_time_permutations",
      200,
      "",
      "At most so many orders of the touches within their poses say what chance gives, in time.",
      "Cost: each is a sum over all touches. They give a mean and a deviation.",
      "Smaller: z scatters. Larger: a slower diagnosis."};
  Rule<int> min_time_permutations{"selection.session.min_time_permutations",
                                  30,
                                  "",
                                  "... and at least so many, however large the set.",
                                  "Not recorded.",
                                  "Smaller: z scatters. Larger: a slower diagnosis of large sets."};
  Rule<int> permuted_touches{"selection.session.permuted_touches",
                             4'000'000,
                             "",
                             "Touches of all these orders together: large sets have fewer orders.",
                             "Cost: bounds time.",
                             "Smaller: z of large sets scatters. Larger: a slower diagnosis of large sets."};
  Rule<double> min_silent{
      "selection.session.min_silent",
      10,
      "",
      "With fewer missed contacts nothing is said of where they are missed.",
      "Not recorded.",
      "Smaller: a few slips are a place. Larger: small sets do not say which finger misses."};
  Rule<double> missed_p{
      "selection.session.missed_p",
      1e-6,
      "probability",
      "Fingers, objects and slopes miss contacts differently if chance gives it less often.",
      "Not recorded.",
      "Smaller: bad fingers go unsaid. Larger: chance blames a finger."};
  Rule<double> silent_rows{"selection.session.silent_rows",
                           0.02,
                           "share",
                           "More rows without any contact are worth a sentence.",
                           "Not recorded.",
                           "Smaller: single slips are told. Larger: rows that are lost go unsaid."};
  Rule<double> min_motion_dof{"selection.session.min_motion_dof",
                              60,
                              "degrees of freedom",
                              "With fewer degrees of freedom no steady motion of an object is looked for.",
                              "Not recorded.",
                              "Smaller: few touches decide. Larger: small sets show no motion."};
  Rule<double> max_order_share{
      "selection.session.max_order_share",
      0.3,
      "share",
      "Without repeats, poses may explain so much of the variance of time, and no more.",
      "Argument: where poses go with the time, a misfit looks like a motion. The number is not recorded.",
      "Smaller: few sets without repeats are asked. Larger: a misfit is a motion."};
  Rule<int> max_moving_rounds{"selection.session.max_moving_rounds",
                              20,
                              "",
                              "With more rounds a motion is not compared with a pose of each round.",
                              "Cost: six values for each round and object. The number is not recorded.",
                              "Smaller: objects put down anew are said to move. Larger: a slower diagnosis."};
  Rule<int> max_moving_objects{"selection.session.max_moving_objects",
                               20,
                               "",
                               "Of more objects no motion is looked for.",
                               "Cost: six values for each object. The number is not recorded.",
                               "Smaller: sets of many objects are not asked. Larger: a slower diagnosis."};
  Rule<size_t> min_objects_in_line{
      "selection.session.min_objects_in_line",
      4,
      "",
      "With fewer objects their values make no line of time.",
      "Argument: two values always lie on a line. The number is not recorded.",
      "Smaller: chance makes lines. Larger: growth over few objects goes unsaid."};
  Rule<double> line_p{"selection.session.line_p",
                      0.01,
                      "probability",
                      "Values are no line of time if a line leaves so much less often by chance.",
                      "Not recorded.",
                      "Smaller: bent courses are lines. Larger: true lines are missed by chance."};
  Rule<double> slope_errors{"selection.session.slope_errors",
                            5,
                            "standard errors",
                            "A line of time grows if its slope is larger than so many of its errors.",
                            "Not recorded.",
                            "Smaller: chance makes growth. Larger: slow growth goes unsaid."};
  Rule<double> same_pattern{
      "selection.session.same_pattern",
      0.995,
      "",
      "Cosine of two effects' columns above which they look alike, at each of two speeds or over both.",
      "Not recorded.",
      "Smaller: pairs are doubted that data tell apart. Larger: pairs at two speeds go undoubted."};
  Rule<double> round_p{"selection.session.round_p",
                       1e-6,
                       "probability",
                       "The object lay elsewhere in every round if chance gives such agreement less often.",
                       "Not recorded.",
                       "Smaller: objects put down anew pass as noise. Larger: chance makes rounds."};
  Rule<double> permuted_below_p{"selection.session.permuted_below_p",
                                0.01,
                                "probability",
                                "Only where the F test gives less, other orders of the repeats are asked.",
                                "Cost: the orders take time. The F test takes noise of one size for granted.",
                                "Smaller: p of uneven noise is too small. Larger: time for nothing."};
  Rule<double> negligible_rounds{
      "selection.session.negligible_rounds",
      0.015,
      "share",
      "Rounds that make less of the floor are negligible.",
      "Not recorded. It was 0.05; an object put down anew each round is named from 1.5 % of the floor on.",
      "Smaller: large sets tell of what nobody sees. Larger: objects put down anew pass as noise."};
  Rule<double> min_round_dof{
      "selection.session.min_round_dof",
      8,
      "degrees of freedom",
      "An object takes part if its repeats have so many more degrees of freedom than its rounds take.",
      "Not recorded.",
      "Smaller: rounds explain everything. Larger: objects with few repeats are not asked."};
};

inline constexpr SessionRules kSessionRules;

}  // namespace touchstone::diagnosis::selection
