// Numbers by which sets of touches are read and compared (server/diagnosis/RULES.md lists all rooms).
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::touches {

struct TouchRules {
  Rule<size_t> max_speeds{
      "touches.max_speeds",
      20,
      "",
      "A summary of the data lists at most so many different speeds.",
      "Display: a list that a reader takes in. The number is not recorded.",
      "Smaller: speeds of the set are missing from the summary. Larger: a list that nobody reads."};
  Rule<size_t> max_examples{"touches.max_examples",
                            5,
                            "",
                            "So many touches are named as examples for each reason why touches are unused.",
                            "Display: examples, not a list. The number is not recorded.",
                            "Smaller: a pattern in them does not show. Larger: a list that nobody reads."};
  Rule<double> max_backward{
      "touches.max_backward",
      0.05,
      "share",
      "With more backward steps of the session time, touches are put in the order of that time.",
      "Not recorded. So many: the file is not in the order of the session; fewer begin new sessions.",
      "Smaller: several short sessions are sorted into one. Larger: a shuffled file is taken for many "
      "sessions."};
  Rule<double> larger_object{
      "touches.larger_object",
      1.5,
      "",
      "Contacts of a touch farther apart than so many times the object's box are impossible.",
      "Not recorded. It is room for an object that is larger than its mesh.",
      "Smaller: touches of an object larger than its mesh are left out. Larger: wild readings stay in the "
      "search."};
  Rule<double> object_apart{"touches.object_apart",
                            0.02,
                            "m",
                            "What an object may lie off, in addition, before contacts count as impossible.",
                            "Not recorded. It is room for an object that lies elsewhere.",
                            "Smaller: touches of an object that lies elsewhere are left out. Larger: wild "
                            "readings of thin objects stay."};
  Rule<double> few_impossible{
      "touches.few_impossible",
      0.01,
      "share",
      "Impossible touches up to this share, or one, are left out; more are no slips, and stay.",
      "Not recorded. Many are no slips of single readings.",
      "Smaller: slips stay in a set that has several. Larger: what is wrong with many touches is not looked "
      "for."};
  Rule<int> block{"touches.block",
                  1024,
                  "",
                  "So many touches of one object are simulated as one batch.",
                  "Cost: memory of a batch, and batches for every thread. The number is not recorded.",
                  "Smaller: more batches with costs of their own. Larger: fewer threads find work."};
  Rule<double> jump{"touches.jump",
                    0.3e-3,
                    "m",
                    "A finger that moves farther within the step of a derivative has met another face: no "
                    "change is counted.",
                    "Not recorded.",
                    "Smaller: fast effects lose their derivative. Larger: an edge passes as an effect."};
  Rule<double> jump_over_median{"touches.jump_over_median",
                                200,
                                "",
                                "... and by more than so many times the median change over all readings.",
                                "Not recorded.",
                                "Smaller: readings that an effect moves most lose their derivative. Larger: "
                                "an edge passes as an effect."};
  Rule<double> min_cosine{
      "touches.min_cosine",
      0.1,
      "",
      "Below this cosine of the incidence a contact is no function of the pose, and slopes grow no further.",
      "Not recorded. It is an incidence of 84 degrees.",
      "Smaller: a few grazing contacts decide. Larger: contacts on steep faces are lost."};
};

inline constexpr TouchRules kTouchRules;

}  // namespace touchstone::diagnosis::touches
