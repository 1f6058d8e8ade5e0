// Numbers by which single rows of a measurement file are found wrong (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::checks {

struct RowCheckRules {
  // Rows that repeat others to the last digit: copies under another number, or times that were not renewed.
  Rule<int> min_beyond_chance{"checks.rows.min_beyond_chance",
                              3,
                              "",
                              "More such rows than this, beyond what chance gives, are told.",
                              "Not recorded.",
                              "Smaller: a coincidence is told. Larger: few copies are missed."};
  Rule<double> over_chance{"checks.rows.over_chance",
                           10,
                           "",
                           "What chance gives is taken so many times as large before rows are told.",
                           "Not recorded.",
                           "Smaller: coarse clocks are called copies. Larger: copies are missed."};
  Rule<double> min_copy_share{"checks.rows.min_copy_share",
                              0.02,
                              "share",
                              "Copies of fewer of the rows are not told.",
                              "Argument: too few to make the noise floor too low.",
                              "Not measured."};
  Rule<double> min_scatter_dof{
      "checks.rows.min_scatter_dof",
      20,
      "degrees of freedom",
      "From so many on repeats that differ tell the scatter; else the model's noise does.",
      "Not recorded.",
      "Smaller: a scatter that is hardly known counts."};
  Rule<double> finest_tick_s{"checks.rows.finest_tick_s",
                             1e-8,
                             "s",
                             "Times that differ by less are no step of the file's resolution.",
                             "Not recorded.",
                             "Smaller: rounding is taken for the resolution."};
  Rule<int> first_lag{"checks.rows.first_lag",
                      3,
                      "",
                      "From so many rows apart on, equal times of two poses are chance alone.",
                      "Argument: a reading that was not renewed repeats its neighbours.",
                      "Smaller: stale rows count as chance."};
  Rule<int> last_lag{"checks.rows.last_lag",
                     30,
                     "",
                     "Up to so many rows apart chance is counted.",
                     "Not recorded.",
                     "Larger: more pairs to compare. Smaller: chance is known less well."};

  // One round at another speed than the file says.
  Rule<double> stands_out{"checks.rows.stands_out",
                          6,
                          "standard errors",
                          "A round whose factor differs from the others' by more may be at another speed.",
                          "Not recorded.",
                          "Smaller: chance is told. Larger: factors near 1.01 are missed."};
  Rule<double> others_agree{"checks.rows.others_agree",
                            4,
                            "standard errors",
                            "Every other round's factor, without that round, lies within this of one.",
                            "Argument: what changes steadily is no factor of one round.",
                            "Larger: a drift is called a speed. Smaller: none is told beside physics."};
  Rule<double> min_speed_difference{"checks.rows.min_speed_difference",
                                    0.003,
                                    "share",
                                    "A difference in speed of less is not worth a word.",
                                    "Not recorded.",
                                    "Smaller: differences that do no harm are told."};
  Rule<double> rest_is_noise_p{
      "checks.rows.rest_is_noise_p",
      1e-4,
      "probability",
      "Where chance gives the round's scatter, without the factor, over the others' less often: no factor.",
      "Argument: a round that differs in another way than by a factor is not claimed.",
      "Not measured."};
  Rule<int> min_pairs{"checks.rows.min_pairs",
                      20,
                      "",
                      "A round needs so many poses that others have touched too.",
                      "Not recorded.",
                      "Smaller: its error is hardly known."};
  Rule<int> min_rounds{"checks.rows.min_rounds",
                       3,
                       "",
                       "Fewer rounds are not compared.",
                       "Argument: of two nobody can say which one is right.",
                       "Smaller: either is blamed."};
  Rule<int> max_rounds{"checks.rows.max_rounds",
                       40,
                       "",
                       "More rounds are not compared.",
                       "Cost: the rounds times the touches.",
                       "Larger: slower."};

  // Times that are cut off at a largest one.
  Rule<int> min_shared{"checks.rows.min_shared",
                       6,
                       "",
                       "So many touches share a finger's largest time, or it is not cut off.",
                       "Not recorded.",
                       "Smaller: coincidences are told."};
  Rule<double> over_others{"checks.rows.over_others",
                           5,
                           "",
                           "And so many times as many as share any of the next ones below.",
                           "Argument: ticks give every time its share of touches.",
                           "Smaller: ticks are told. Larger: a cut that hits few is missed."};
  Rule<int> compared_times{"checks.rows.compared_times",
                           10,
                           "",
                           "So many times below the largest are compared with it.",
                           "Not recorded.",
                           "Not measured."};
  Rule<double> later_share{"checks.rows.later_share",
                           0.8,
                           "share",
                           "So many of these touches are expected later than the largest time.",
                           "Argument: ticks have as many expected before as after.",
                           "Smaller: ticks are told. Larger: noise hides a cut."};
  Rule<double> min_late_m{"checks.rows.min_late_m",
                          2e-4,
                          "m",
                          "By this travel half of them are late at least, and their middle half differs.",
                          "Argument: repeats and copies share what is expected.",
                          "Smaller: repeats are told. Larger: a cut that takes little is missed."};
};
inline constexpr RowCheckRules kRowCheckRules;

}  // namespace touchstone::diagnosis::checks
