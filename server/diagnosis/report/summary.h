// What a report says in sentences.
#pragma once

#include <string>

#include "server/diagnosis/touches/observations.h"

namespace touchstone {

// Rows, objects, poses, repeats, speeds, what was left out and why.
void DescribeData(const Observations& observations, v1::Report* report);

// What limits the report: few objects, no repeats, few touches.
void AddWarnings(const Observations& observations, v1::Report* report);

// One paragraph: how wrong, why, what to do. The numbers must stand in the report already.
std::string Summary(const v1::Report& report);

}  // namespace touchstone
