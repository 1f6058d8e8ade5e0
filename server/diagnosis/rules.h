// Numbers of the facade; those of its rooms stand in the folders.
#pragma once

#include "server/base/numbers/rule.h"

namespace touchstone::diagnosis {

struct DiagnosisRules {
  Rule<int> default_touches{"diagnosis.default_touches",
                            8,
                            "",
                            "Touches proposed where a diagnosis leaves explanations confounded.",
                            "Not recorded.",
                            "Not measured."};
  Rule<int> default_photographs{
      "diagnosis.default_photographs", 6, "", "... photographs.", "Not recorded.", "Not measured."};
  Rule<double> max_left_by_others{
      "diagnosis.max_left_by_others",
      0.7,
      "share",
      "Of the error: photographs without the odd ones that keep more are as wrong; no single pictures are "
      "blamed.",
      "Sets: a strong cast shadow with another exposure was told as five odd pictures.",
      "Larger: physics of all pictures is blamed on some. Smaller: mistakes of single pictures go unsaid."};
};
inline constexpr DiagnosisRules kDiagnosisRules;

}  // namespace touchstone::diagnosis
