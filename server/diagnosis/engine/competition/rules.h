// Numbers by which explanations compete, and by which a plan's blind spots are found.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::engine {

struct CompetitionRules {
  Rule<double> max_probability{
      "engine.competition.max_probability",
      0.999,
      "probability",
      "No explanation is called more probable.",
      "Argument: it is one among the causes that somebody has thought of; the true one may be another.",
      "Larger: steps look certain where a cause that nobody listed would do. Smaller: sure ones look "
      "doubtful."};
  Rule<double> same_likelihood_nats{
      "engine.competition.same_likelihood_nats",
      1,
      "nats",
      "An effect whose likelihood is less than this behind a step's is as likely as the step.",
      "Argument: less is no difference.",
      "Smaller: equivalent effects with other priors are not named. Larger: worse ones are."};
  Rule<double> value_tolerance{
      "engine.competition.value_tolerance",
      1e-6,
      "share",
      "Of a value's typical size: nearer to no change or to a bound, a value is there.",
      "Not recorded.",
      "Not measured."};
  Rule<double> worth_saying_nats{
      "engine.competition.worth_saying_nats",
      5,
      "nats",
      "What has no name is named beside a step unless it is farther behind.",
      "Sets: 20 sets with a step or a warm-up of 3 ms; none is named with P above 0.9.",
      "Smaller: a course in time goes unsaid. Larger: true effects are told with a rival."};
  Rule<size_t> max_left{"engine.competition.max_left",
                        4,
                        "",
                        "Models between which further measurements are to tell, at most.",
                        "Cost: each is predicted at every candidate measurement.",
                        "Not measured."};
  Rule<double> clear_share{
      "engine.competition.clear_share",
      0.2,
      "share",
      "Of a step's gain, that a declared rival must be behind where derivatives are rough; nearer, they are "
      "equivalent.",
      "Argument: an explanation that is slightly off in value or place loses more than the likelihood knows.",
      "Smaller: small sets from one distance told camera_translation as object_scale. Larger: more ties."};
  Rule<double> alike{
      "engine.competition.alike",
      0.03,
      "share",
      "An effect acts as another one where it leaves out no larger share of the other's response.",
      "Argument: only its bounds stop it then, and they tell the two apart no more than a belief does.",
      "Smaller: a bound decides between two causes. Larger: different effects count as one."};
  Rule<int> max_fitted{"engine.competition.max_fitted",
                       8,
                       "",
                       "Candidates that the ranking fits in full.",
                       "Cost: a fit each; the others are ranked by their linearised prediction.",
                       "Smaller: the error that a candidate alone would leave is not told of more of them."};
  Rule<int> max_fitted_on_one{
      "engine.competition.max_fitted_on_one",
      3,
      "",
      "... of those that do not act on all objects alike; the others of these are not listed.",
      "Cost: a fit each; there are many.",
      "Not measured."};
  Rule<size_t> max_taken_over{"engine.competition.max_taken_over",
                              6,
                              "",
                              "Effects that are named for doing a part of what an asked effect does.",
                              "Display: the largest shares first.",
                              "Not measured."};
  Rule<double> worth_naming_share{
      "engine.competition.worth_naming_share",
      0.2,
      "share",
      "Of what the asked effect does: an effect that does less of it is not named.",
      "Not recorded.",
      "Not measured."};
  Rule<double> detection_power{
      "engine.competition.detection_power",
      0.8,
      "probability",
      "Share of sets in which an effect of the named size is found.",
      "Argument: a convention of the design of experiments. Beside it stands kNormalQuantile80 (told apart).",
      "Test: PredictedPower.IsThatOfDiagnoses. Larger: larger sizes are named."};
  Rule<int> max_size_steps{"engine.competition.max_size_steps",
                           8,
                           "",
                           "Steps towards the size that is found, or told apart.",
                           "Cost: a simulation each.",
                           "Smaller: sizes are less exact, or none is named."};
  Rule<double> size_tolerance{"engine.competition.size_tolerance",
                              0.02,
                              "share",
                              "Of a size: a smaller change ends the steps.",
                              "Not recorded.",
                              "Larger: sizes are less exact. Smaller: more simulations."};
  Rule<double> max_growth{"engine.competition.max_growth",
                          30,
                          "",
                          "Factor by which one step may change a size.",
                          "Not recorded.",
                          "Not measured."};
  Rule<size_t> max_rivals_compared{"engine.competition.max_rivals_compared",
                                   4,
                                   "",
                                   "Rivals whose evidence is computed, those that resemble the effect most.",
                                   "Cost: an evidence each.",
                                   "Not measured."};
  Rule<double> no_response{"engine.competition.no_response",
                           1e-6,
                           "sigma",
                           "Rows that move less (root mean square) do not move.",
                           "Not recorded.",
                           "Not measured."};
  Rule<double> no_gain_nats{"engine.competition.no_gain_nats",
                            0.05,
                            "nats",
                            "A rival that gains less likelihood is none.",
                            "Argument: its bounds keep it from acting the right way.",
                            "Larger: weak rivals go unnamed."};
  Rule<double> no_resemblance{
      "engine.competition.no_resemblance",
      0.1,
      "",
      "Correlation of responses below which an effect is no rival.",
      "Not recorded.",
      "Smaller: rivals are named that share nothing. Larger: weak rivals go unnamed."};
  Rule<int> max_rival_steps{"engine.competition.max_rival_steps",
                            6,
                            "",
                            "Steps of Gauss and Newton to a rival's best values.",
                            "Cost: a simulation each.",
                            "Smaller: rivals look worse than they are, and effects easier to tell apart."};
  Rule<double> uneven_nats{
      "engine.competition.uneven_nats",
      10,
      "nats",
      "Gain beyond half a logarithm of the count per scale that parts of unequal scatter need.",
      "Not recorded.",
      "Smaller: chance makes scatter uneven. Larger: scatter that differs is taken for heavy tails."};
  Rule<double> uneven_ratio{
      "engine.competition.uneven_ratio",
      4.0 / 3,
      "",
      "Largest scale over the smallest below which scatter is not uneven.",
      "Not recorded.",
      "Smaller: long sets are uneven by differences that mislead nobody. Larger: visible ones go unsaid."};
  Rule<double> alike_uneven_share{"engine.competition.alike_uneven_share",
                                  0.6,
                                  "share",
                                  "Of the best division's gain: a division that gains as much says nearly "
                                  "the same and is named beside it.",
                                  "Not recorded.",
                                  "Not measured."};
};
inline constexpr CompetitionRules kCompetitionRules;

}  // namespace touchstone::diagnosis::engine
