// The measurement file (DESIGN 7): CSV, one touch a row, millimetres, microseconds, mm/s. A plan is the same
// file without times.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "touchstone/v1/types.pb.h"

namespace touchstone::client {

// One row; SI inside, as on the wire.
struct MeasuredTouch {
  uint64_t touch = 0;
  std::string object;
  v1::CommandedTouch commanded;
  // One a finger, NaN where it reported nothing; empty in a plan.
  std::vector<double> time_s;
};

// "t_l_us" ...
std::string TimeColumnName(int finger, int fingers);

// The header line for `fingers` time columns (0: a plan), with session_time_s if asked and these covariates.
std::string MeasurementHeader(int fingers, bool session_time, const std::vector<std::string>& covariates);

// One row to such a header, line end included.
std::string MeasurementRow(const MeasuredTouch& touch, bool session_time,
                           const std::vector<std::string>& covariates);

// A whole file; writes session_time_s and the covariates that any row has.
std::string FormatMeasurements(const std::vector<MeasuredTouch>& touches);

// Reads a measurement file or a plan as server/session/measurement_set.h does, as messages; the poses must be
// there.
absl::StatusOr<std::vector<MeasuredTouch>> ParseMeasurements(const std::string& text,
                                                             const std::string& origin);

}  // namespace touchstone::client
