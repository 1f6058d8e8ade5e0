// The bulky parts of the sample reports: points, curves, histograms, groups.
#pragma once

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

// 960 touches x 3 fingers on the report's objects: parity, surface points, outlines, curves, histograms,
// groups and worst touches, whose residuals have about the given RMSE before and the floor after.
void AddEvidence(double initial_us, double floor_us, v1::DataReport* data);
void AddHistograms(double spread_us, v1::DataReport* data);
void AddProposals(int touches, const char* purpose, v1::Report* report);

}  // namespace touchstone::client
