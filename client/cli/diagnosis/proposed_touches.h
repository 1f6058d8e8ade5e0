// The touches that a report proposes, as a plan.
#pragma once

#include <string>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::cli {

// Report.next as a measurement file without times. Every entry is a touch.
std::string PlanOfTouches(const v1::Report& report);

}  // namespace touchstone::cli
