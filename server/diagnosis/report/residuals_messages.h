// Descriptions of residuals as parts of the wire message, in its units (us, mm).
#pragma once

#include "server/diagnosis/residuals/describe_residuals.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// Appends slices, groups, finger bias, worst touches, curves, histograms, parity, surface points and outlines
// to the report. `fingers`: how many the rig has, for their names.
void WriteResiduals(const residuals::ResidualSummary& residuals, int fingers, v1::Report* report);

// Also used for sets without poses.
void WriteHistogram(const residuals::ComparedHistogram& histogram, v1::Report* report);

}  // namespace touchstone::diagnosis::report
