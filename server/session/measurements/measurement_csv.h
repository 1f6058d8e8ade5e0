// The measurement file (format: proto/README.md): CSV, one touch per row, mm, us, mm/s. A plan is the same file without
// times.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "touchstone/v1/types.pb.h"

namespace touchstone::session {

// One row; SI inside, as on the wire.
struct MeasuredTouch {
  uint64_t touch = 0;
  std::string object;
  v1::CommandedTouch commanded;
  // One per finger, NaN where it reported nothing; empty in a plan.
  std::vector<double> time_s;
  std::optional<int> round, face;
};

// "t_l_us" ...
std::string TimeColumnName(int finger, int fingers);

// Which optional columns a file has.
struct MeasurementColumns {
  bool session_time = false;
  bool round = false;
  bool face = false;
  std::vector<std::string> covariates;
};

// The optional columns that a file of these touches has: those that any of them has, but round and face only where
// every touch has them.
MeasurementColumns OptionalColumnsOf(const std::vector<MeasuredTouch>& touches);

// The header line for `fingers` time columns (0: a plan).
std::string MeasurementHeader(int fingers, const MeasurementColumns& columns);

// One row to such a header, line end included.
std::string MeasurementRow(const MeasuredTouch& touch, const MeasurementColumns& columns);

// A whole file; writes the optional columns that any row has (round and face: that every row has).
std::string FormatMeasurements(const std::vector<MeasuredTouch>& touches);

// Reads a measurement file or a plan as measurement_set.h does, as messages; the poses must be there.
absl::StatusOr<std::vector<MeasuredTouch>> ParseMeasurements(const std::string& text,
                                                             const std::string& origin);

}  // namespace touchstone::session
