// Numbers by which kinds of scatter are told apart (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::selection {

struct ScatterRules {
  Rule<double> motion{"selection.scatter.motion",
                      10,
                      "nats",
                      "What a motion of the object or the arm must gain over equal noise of all fingers.",
                      "Not recorded.",
                      "Smaller: chance makes play. Larger: play passes as noise of the fingers."};
  Rule<double> ahead_of_noise{
      "selection.scatter.ahead_of_noise",
      4,
      "nats",
      "Motion this far ahead of noise of the fingers is said; this far behind it is not; between, noise is "
      "doubted.",
      "Not recorded.",
      "Smaller: the less likely of two is asserted. Larger: clear cases stay in doubt."};
  Rule<double> min_motion_dof{"selection.scatter.min_motion_dof",
                              60,
                              "degrees of freedom",
                              "With fewer degrees of freedom of repeats no motion is looked for.",
                              "Not recorded.",
                              "Smaller: few repeats decide. Larger: small sets show no play."};
  Rule<int> motion_ratios{"selection.scatter.motion_ratios",
                          48,
                          "",
                          "So many ratios of the motion's scatter to the noise's (squares) are tried.",
                          "Cost: each is a likelihood. Steps of 1.2.",
                          "Smaller: the size of a motion is inexact. Larger: time for nothing."};
  Rule<double> smallest_ratio{"selection.scatter.smallest_ratio",
                              0.01,
                              "",
                              "The smallest such ratio.",
                              "Not recorded.",
                              "Larger: small motions are missed. Smaller: a coarser grid."};
  Rule<double> largest_ratio{
      "selection.scatter.largest_ratio",
      100,
      "",
      "The largest such ratio.",
      "Not recorded.",
      "Smaller: motions much larger than the noise are too small. Larger: a coarser grid."};
  Rule<int> min_complete{"selection.scatter.min_complete",
                         60,
                         "",
                         "With fewer touches of all fingers no correlated noise is looked for.",
                         "Not recorded.",
                         "Smaller: few touches decide. Larger: small sets show no memory."};
  Rule<double> forgets{"selection.scatter.forgets",
                       4,
                       "nats",
                       "Noise that is ahead of a random walk by more reverts to its mean.",
                       "Sets: simulated walks of 960 touches; 1 in 300 is beyond.",
                       "Test: NoiseMemory.ARandomWalkDoesNotRevertAndCorrelatedNoiseDoes. Larger: correlated "
                       "noise is a drift."};
  Rule<double> memory_step{
      "selection.scatter.memory_step",
      0.2,
      "",
      "The step in the logarithm of a value over which the likelihood's curvature is taken.",
      "Not recorded.",
      "Smaller: rounding enters the standard error. Larger: the likelihood is no parabola over it."};
  Rule<double> memory_max_step{
      "selection.scatter.memory_max_step",
      2,
      "",
      "The largest error of such a logarithm that counts for the noise without memory.",
      "Not recorded.",
      "Smaller: the error of the white noise is too small. Larger: it is that of values nobody believes."};
  Rule<int> min_cycles{
      "selection.scatter.min_cycles",
      3,
      "",
      "A course that repeats has at least so many cycles.",
      "Not recorded.",
      "Smaller: bends of correlated noise are periods. Larger: slow periods pass as correlated noise."};
  Rule<double> delay{"selection.scatter.delay",
                     10,
                     "nats",
                     "What a random delay must gain over the best noise without delays to be said.",
                     "Not recorded.",
                     "Smaller: heavy tails are delays. Larger: delays pass as heavy tails."};
  Rule<double> two_values{"selection.scatter.two_values",
                          3,
                          "nats",
                          "What two values of a delay must gain over none for other shapes to be tried.",
                          "Cost: the other shapes are integrals. The number is not recorded.",
                          "Smaller: time for nothing. Larger: delays of other shapes are missed."};
  Rule<double> delay_of_length{
      "selection.scatter.delay_of_length",
      3,
      "nats",
      "By which a delay of the travel must be ahead of one of the time.",
      "Not recorded.",
      "Smaller: chance makes delays of travel. Larger: they pass as delays of time."};
  Rule<double> one_finger{"selection.scatter.one_finger",
                          3,
                          "nats",
                          "By which a delay, or uneven scatter, of one finger must be ahead of that of all.",
                          "Not recorded.",
                          "Smaller: chance picks a finger. Larger: one bad finger passes as all."};
  Rule<double> delay_scales{
      "selection.scatter.delay_scales",
      3,
      "nats",
      "By which delays beside kinds of noise must be ahead of delays of plain noise.",
      "Not recorded.",
      "Smaller: kinds of noise stay that delays explain. Larger: kinds go that are there."};
  Rule<size_t> min_delay_touches{"selection.scatter.min_delay_touches",
                                 60,
                                 "",
                                 "With fewer touches of three fingers no delay is looked for.",
                                 "Not recorded.",
                                 "Smaller: few touches decide. Larger: small sets show no delay."};
  Rule<size_t> max_delay_touches{"selection.scatter.max_delay_touches",
                                 800,
                                 "",
                                 "Delays are looked for in at most so many touches of a large set, evenly.",
                                 "Cost: bounds time. The number is not recorded.",
                                 "Smaller: rare delays are missed. Larger: a slower diagnosis."};
  Rule<double> min_of_each_value{"selection.scatter.min_of_each_value",
                                 10,
                                 "",
                                 "So many readings must be late, and as many in time.",
                                 "Not recorded.",
                                 "Smaller: a few outliers are a delay. Larger: rare delays are missed."};
  Rule<int> delay_first_steps{"selection.scatter.delay_first_steps",
                              5,
                              "",
                              "So many steps of the expectation-maximisation from each start.",
                              "Cost: a dozen starts. The number is not recorded.",
                              "Smaller: the wrong start goes on. Larger: time for nothing."};
  Rule<int> delay_steps{"selection.scatter.delay_steps",
                        60,
                        "",
                        "So many further steps from the best one.",
                        "Cost: bounds time. The number is not recorded.",
                        "Smaller: values have not converged. Larger: time for nothing."};
  Rule<double> delay_first{"selection.scatter.delay_first",
                           2,
                           "nats",
                           "What the best start must gain after its first steps for the further ones.",
                           "Cost: most sets have no delay.",
                           "Smaller: time for nothing. Larger: weak delays are missed."};
  Rule<int> delay_sections{"selection.scatter.delay_sections",
                           12,
                           "",
                           "Golden section steps for the share of the variance that is a delay's.",
                           "Cost: each is an integral for each touch. The number is not recorded.",
                           "Smaller: the size of a delay is inexact. Larger: time for nothing."};
  Rule<double> lopsided{"selection.scatter.lopsided",
                        4.4,
                        "standard errors",
                        "A third moment that is larger over its spread by chance makes the scatter lopsided.",
                        "Argument: a two-sided p of 1e-5.",
                        "Smaller: chance makes lopsided scatter. Larger: weak delays go unsaid."};
  Rule<double> lopsided_ratio{
      "selection.scatter.lopsided_ratio",
      1.1,
      "",
      "... and if the farther side reaches so many times as far as the other.",
      "Not recorded. It was 1.25 before each finger was assessed by itself.",
      "Smaller: large sets tell of what nobody sees. Larger: delays of few readings go unsaid."};
  Rule<double> farthest{"selection.scatter.farthest",
                        4,
                        "sigma",
                        "A single reading counts for no more in the third moment.",
                        "Not recorded.",
                        "Smaller: tails, which are what is asked, are cut off. Larger: few readings decide."};
  Rule<size_t> min_lopsided_readings{
      "selection.scatter.min_lopsided_readings",
      120,
      "",
      "With fewer readings of one finger its sides are not compared.",
      "Not recorded.",
      "Smaller: few readings decide. Larger: small sets show no lopsided scatter."};
  Rule<double> outermost{"selection.scatter.outermost",
                         0.025,
                         "share",
                         "Share of the readings beyond the points that are compared, on each side.",
                         "Argument: the words say two or three of a hundred.",
                         "Smaller: few readings decide. Larger: tails do not show."};
  Rule<int> slips{"selection.scatter.slips",
                  3,
                  "",
                  "Up to so many single readings set aside are slips and no finding.",
                  "Not recorded.",
                  "Smaller: a single slip makes the verdict UNEXPLAINED. Larger: bad readings go unsaid."};
  Rule<int> min_touches_of_part{
      "selection.scatter.min_touches_of_part",
      15,
      "",
      "A part with fewer touches is not compared.",
      "Not recorded.",
      "Smaller: chance in small parts. Larger: objects with few touches are not compared."};
  Rule<int> max_parts{"selection.scatter.max_parts",
                      24,
                      "",
                      "A value that parts the touches into more is not tried.",
                      "Not recorded.",
                      "Smaller: rounds of long sessions are not compared. Larger: many small parts."};
  Rule<size_t> max_uneven_touches{
      "selection.scatter.max_uneven_touches",
      3000,
      "",
      "Scatter of parts is compared on at most so many touches of a large set, evenly.",
      "Cost: tails are integrals for each touch. The number is not recorded.",
      "Smaller: small differences are missed. Larger: a slower diagnosis."};
};

inline constexpr ScatterRules kScatterRules;

}  // namespace touchstone::diagnosis::selection
