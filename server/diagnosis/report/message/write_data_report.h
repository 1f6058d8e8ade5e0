// What one kind of measurement says, as a part of the wire message.
#pragma once

#include <vector>

#include "server/diagnosis/report/diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// All but the model of what is unexplained.
v1::DataReport ToMessage(const DataReport& data);

// Its parts that belong to one kind: write_touches.cpp, write_photographs.cpp, write_distributions.cpp.
void WriteTouches(const DataReport& data, v1::DataReport* message);
void WritePhotographs(const PhotographDescription& photographs, v1::PhotographSummary* message);
void WriteDistributions(const distributions::PoseFreeComparison& comparison,
                        v1::DistributionComparison* message);

// A residual as blue (-scale or less), white (0), red (scale or more): width x height x 3.
std::vector<uint8_t> ResidualColours(const std::vector<float>& residual_grey, double scale_grey);

}  // namespace touchstone::diagnosis::report
