// Whether readings scatter farther to one side than to the other: contacts that come late now and then. Neither normal noise
// nor Student's t does.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/touches/noise/noise_kinds.h"

namespace touchstone::diagnosis::selection {

struct LopsidedScatter {
  int finger = -1;  // whose scatter it is; -1: of all
  double z = 0;     // of the third moment over its spread by chance; above 0: late
  double late_s = 0,
         early_s = 0;  // 2.5 % of the readings are later, and as many earlier, than the others of their touch
  std::string words;   // sentences for people
};

// `groups`: residuals; those of fewer than three fingers say nothing. Turning the signs of a touch's residuals changes
// nothing where the noise of each finger is symmetric, so the third moment is compared with what such turns make of it. Nothing
// where it is no larger, or the two sides differ by less than a tenth.
std::optional<LopsidedScatter> FindLopsidedScatter(const std::vector<touches::ReadingGroup>& groups,
                                                   int fingers);

}  // namespace touchstone::diagnosis::selection
