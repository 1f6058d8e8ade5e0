// Numbers by which steps are ordered, doubted and put into words.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::engine {

struct LadderRules {
  Rule<double> zero_errors{
      "engine.ladder.zero_errors",
      2,
      "standard errors",
      "A refitted value that lies no farther from no change may be superfluous.",
      "Argument: about the 95 % interval.",
      "Larger: effects are dropped that a weak value needs. Smaller: superfluous effects stay."};
  Rule<double> doubted{
      "engine.ladder.doubted",
      0.5,
      "probability",
      "Most that a step beside a rest without a name has, where it explains nothing of what is left.",
      "Argument: it may stand in for something else as well as not.",
      "Larger: wrong steps look sure. Smaller: right ones look doubtful."};
  Rule<double> max_beside_rest{
      "engine.ladder.max_beside_rest",
      0.9,
      "probability",
      "... where it explains all but a trace; between the two by the share that is explained.",
      "Not recorded.",
      "Larger: wrong steps look sure. Smaller: right ones look doubtful."};
  Rule<double> doubtful{
      "engine.ladder.doubtful",
      0.5,
      "probability",
      "A less probable step must lower the held-out error by SearchRules::min_relative_cv_gain to stay.",
      "Argument: it is rather none. Sets: one with P 0.13 stood for a gain of 0.2 % on unseen touches.",
      "Smaller: such steps stay. Larger: weak true steps go."};
  Rule<int> max_fits{"engine.ladder.max_fits",
                     80,
                     "",
                     "Fits of one search for an order of steps; beyond them there is none.",
                     "Cost: a fit each; six steps need 21 where the first order does.",
                     "Smaller: steps that need each other are taken out. Larger: slower with many steps."};
  Rule<double> agree_errors{"engine.ladder.agree_errors",
                            1.5,
                            "standard errors",
                            "Values of fingers agree where their range is at most sqrt(2) times as much.",
                            "Not recorded.",
                            "Not measured."};
  Rule<double> differ_errors{
      "engine.ladder.differ_errors",
      6,
      "standard errors",
      "... and a step is said to act on one finger where its value lies farther from their mean.",
      "Not recorded.",
      "Smaller: chance names a finger. Larger: a step on one finger is not told so."};
};
inline constexpr LadderRules kLadderRules;

}  // namespace touchstone::diagnosis::engine
