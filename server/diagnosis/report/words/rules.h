// Numbers by which summaries warn, and by which they are cut.
#pragma once

#include <cstddef>

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::report {

struct WordsRules {
  Rule<int> few_touches{"report.words.few_touches",
                        100,
                        "",
                        "Touches below which a warning says that weak effects stay unseen.",
                        "Not recorded.",
                        "Not measured."};
  Rule<int> few_pictures{"report.words.few_pictures",
                         30,
                         "",
                         "... photographs or pictures of a board.",
                         "Not recorded.",
                         "Not measured."};
  Rule<double> noise_differs_widths{"report.words.noise_differs_widths",
                                    1.7,
                                    "",
                                    "Half widths of the 95 % interval by which the scatter of repeats must "
                                    "differ from the declared noise to be said.",
                                    "Argument: 3.3 standard errors.",
                                    "Smaller: chance is said to differ. Larger: wrong noise goes unsaid."};
  Rule<double> noise_differs_share{"report.words.noise_differs_share",
                                   0.02,
                                   "share",
                                   "... and the share of the declared noise.",
                                   "Not recorded.",
                                   "Not measured."};
  Rule<size_t> max_values_shown{"report.words.max_values_shown",
                                4,
                                "",
                                "Values of an effect that a sentence lists; of more it gives the number.",
                                "Display: the length of a sentence.",
                                "Not measured."};
  Rule<size_t> max_runs{
      "report.words.max_runs",
      4,
      "",
      "Runs of sessions listed for a value that changed; of more, the two sessions that differ most.",
      "Display: the length of a sentence.",
      "Not measured."};
  Rule<size_t> max_names{"report.words.max_names",
                         3,
                         "",
                         "Sessions of a run that are named; of more, its first and its last.",
                         "Display: the length of a sentence.",
                         "Not measured."};
  Rule<double> same_poses_p{
      "report.words.same_poses_p",
      1e-4,
      "probability",
      "Poses that two sessions touched differ beyond noise where chance is less probable.",
      "Not recorded.",
      "Larger: sessions differ by chance. Smaller: a change that no value describes goes unsaid."};
};
inline constexpr WordsRules kWordsRules;

}  // namespace touchstone::diagnosis::report
