// Numbers by which several kinds of measurement, and several sessions, are explained together.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::joint {

struct JointRules {
  Rule<int> max_iterations{"joint.max_iterations",
                           15,
                           "",
                           "Steps of Gauss and Newton of a joint fit at most.",
                           "Cost: each step simulates the derivatives of every kind.",
                           "Smaller: fits far from their start end before the best values."};
  Rule<int> max_halvings{"joint.max_halvings",
                         6,
                         "",
                         "How often a step of a joint fit that gains nothing is halved.",
                         "Cost: each halving predicts every kind.",
                         "Not measured."};
  Rule<int> noise_passes{"joint.noise_passes",
                         6,
                         "",
                         "Passes in which the noise of each kind and the joint step are found by turns.",
                         "Not recorded.",
                         "Smaller: a kind whose noise is unknown weighs too much or too little."};
  Rule<double> conflict_nats{
      "joint.conflict_nats",
      9,
      "nats",
      "Gain that values of each kind's own need over one value for all, to be a contradiction.",
      "Not recorded.",
      "Smaller: kinds are told to contradict each other by chance. Larger: a contradiction is averaged."};
  Rule<double> conflict_p{
      "joint.conflict_p",
      1e-4,
      "probability",
      "... and values so far apart must be less probable by chance.",
      "Not recorded.",
      "Larger: kinds are told to contradict each other by chance. Smaller: a contradiction is averaged."};
  Rule<int> passes{"joint.passes",
                   2,
                   "",
                   "Passes over shared values and what stands beside them in each kind.",
                   "Cost: a search of every kind per pass.",
                   "Not measured."};
  Rule<int> max_tried{"joint.max_tried",
                      3,
                      "",
                      "Forms of effects tried per round, beside those that a kind names by itself.",
                      "Cost: a joint fit and a search of every kind for each.",
                      "Smaller: the right form may not be tried."};
  Rule<double> worth_trying_nats{
      "joint.worth_trying_nats",
      3,
      "nats",
      "Gain that one kind, or all together, must expect of a form for it to be tried.",
      "Not recorded.",
      "Smaller: more joint fits. Larger: weak shared effects are missed."};
  Rule<int> max_shared{"joint.max_shared",
                       6,
                       "",
                       "Effects that kinds share at most.",
                       "Cost: a round of joint fits each.",
                       "Smaller: sets of many shared causes stay unexplained."};
  Rule<double> shown_p{
      "joint.shown_p",
      1e-3,
      "probability",
      "One kind by itself shows a shared effect where its own values are less probable by chance.",
      "Not recorded.",
      "Not measured."};
  Rule<double> max_unknown_over_typical{
      "joint.max_unknown_over_typical",
      10,
      "",
      "A standard error of more typical sizes means that a kind does not know the value.",
      "Argument: a value that is known no better is not known.",
      "Not measured."};
  Rule<double> scatter_chance{
      "joint.scatter_chance",
      1e-3,
      "probability",
      "Blocks of a session share errors where their scatter is less probable by chance, over all that is "
      "tried.",
      "Not recorded.",
      "Larger: errors of values grow by chance. Smaller: sessions that drift are said to differ."};
  Rule<double> moved_share{
      "joint.moved_share",
      1e-3,
      "share",
      "Of a column's largest entry: a row that a value moves less does not count as moved.",
      "Not recorded.",
      "Not measured."};
  Rule<double> changed_p{
      "joint.changed_p",
      0.01,
      "probability",
      "Sessions have values of their own where chance is less probable, over all effects compared.",
      "Not recorded.",
      "Larger: values change by chance. Smaller: changes are averaged."};
  Rule<double> changed_nats{"joint.changed_nats",
                            1,
                            "nats",
                            "... and where the log evidence gains as much.",
                            "Not recorded.",
                            "Larger: changes are averaged. Smaller: the p value decides alone."};
  Rule<int> max_moves{"joint.max_moves",
                      100,
                      "",
                      "Changes of which values sessions share, at most.",
                      "Cost: bounds the search; each move compares all effects.",
                      "Not measured."};
  Rule<double> changed_errors{
      "joint.changed_errors",
      3,
      "standard errors",
      "Where an effect has changed, the entry that differs most has, and each that differs by as much.",
      "Not recorded.",
      "Not measured."};
  Rule<double> run_errors{
      "joint.run_errors",
      3,
      "standard errors",
      "Between a session and the mean of the run before it: a session that differs more begins a run.",
      "Not recorded.",
      "Smaller: chance begins runs. Larger: the session in which a value changed is not named."};
  Rule<double> gradient_step{"joint.gradient_step",
                             1e-4,
                             "share",
                             "Step of derivatives of a described entry, over the parameter's scale.",
                             "Not recorded.",
                             "Not measured."};
  Rule<size_t> min_for_scatter{"joint.min_for_scatter",
                               3,
                               "",
                               "Sessions: of fewer no scatter between them is told.",
                               "Not recorded.",
                               "Smaller: a scatter from one difference."};
  Rule<size_t> min_for_limits{"joint.min_for_limits",
                              4,
                              "",
                              "Sessions: of fewer there are no control limits.",
                              "Argument: of three no one can be told from the other two.",
                              "Not measured."};
  Rule<double> limit_deviations{
      "joint.limit_deviations",
      3,
      "standard errors",
      "Distance of the control limits from the mean, in the deviations that a session is expected to have.",
      "Argument: Shewhart's limits.",
      "Smaller: chance puts sessions outside. Larger: a session that changed is inside."};
};
inline constexpr JointRules kJointRules;

}  // namespace touchstone::diagnosis::joint
