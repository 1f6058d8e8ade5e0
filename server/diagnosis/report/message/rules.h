// Numbers by which the report's message is drawn and cut.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis::report {

struct MessageRules {
  Rule<double> told_at_once{"report.message.told_at_once",
                            1.05,
                            "",
                            "An effect told apart from its rival at no more than this over the size found "
                            "needs no other measurement.",
                            "Not recorded.",
                            "Not measured."};
  Rule<double> min_scale_grey{"report.message.min_scale_grey",
                              8,
                              "grey levels",
                              "Least full scale of residual maps.",
                              "Not recorded.",
                              "Smaller: noise alone fills the colours. Larger: small residuals stay pale."};
  Rule<double> scale_share{"report.message.scale_share",
                           0.995,
                           "share",
                           "Of the pixels, that the scale of a residual map covers.",
                           "Not recorded.",
                           "Larger: single pixels set the scale. Smaller: more pixels lie beyond it."};
};
inline constexpr MessageRules kMessageRules;

}  // namespace touchstone::diagnosis::report
