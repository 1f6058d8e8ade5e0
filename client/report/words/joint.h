// What a report of touches and photographs together says of both, beside what either alone would say.
#pragma once

#include <string>

#include "client/report/words/text_layout.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

// "falls from 26.2 to 3.1 ms on touches and from 6.35 to 1.43 grey on pictures", of what falls; empty: neither does.
std::string FallsOfBoth(const v1::Report& report);

// The ladder of both errors, the shared values with what either kind alone would give, and the summary. Nothing unless
// IsJoint.
void AddJoint(const v1::Report& report, TextLayout* out);

}  // namespace touchstone::client
