// A measurement file (format: proto/README.md) as columns: what the diagnosis reads. SI units, object frame. A million
// rows are read in seconds, in about 200 bytes per row.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <Eigen/Core>

#include "server/model/finger_name.h"

namespace touchstone::session {

struct MeasurementSet {
  std::string origin;      // what messages call it: the path
  int fingers = 0;         // 0: a plan, which has no times
  bool has_poses = false;  // false: only object and times; the pose columns below are empty
  bool has_session_time = false;
  std::vector<std::string> objects;  // in order of appearance

  // One entry per touch, in the order of the file.
  std::vector<uint64_t> touch;  // its number in the file; without that column 0, 1, ...
  std::vector<int> object;      // index into objects
  std::vector<Eigen::Vector3d> target_m, approach, lateral;  // exactly unit and perpendicular
  std::vector<double> standoff_m, speed_m_s;
  std::vector<double> session_time_s;                     // 0 if the file has none
  std::vector<int> round, face;                           // empty if the file has none
  std::map<std::string, std::vector<double>> covariates;  // "cov_temperature"; NaN: the field is empty
  std::vector<int> line;                                  // in the file, from 1: for messages

  // Reported times, [touch * fingers + finger], seconds; NaN: the finger reported nothing.
  std::vector<double> time_s;

  int size() const { return static_cast<int>(object.size()); }
  double TimeS(int row, int finger) const { return time_s[static_cast<size_t>(row) * fingers + finger]; }
};

// The most that a set may have; beyond it, RESOURCE_EXHAUSTED names the limit as a server's configuration does.
struct MeasurementLimits {
  size_t max_touches = 2147483646;  // line numbers are ints
  size_t max_columns = 4096;
  size_t max_objects = 2147483646;
  double max_time_us = 1e12;  // eleven days: no approach takes longer
};

// Reads the bytes of a measurement file or of a plan. Errors name `origin`, line, column, what is wrong and
// what was expected: a missing or unknown column, a number that is none (NaN and infinities too), a vector
// that is not of unit length, a touch number that stands twice. Nothing is dropped.
absl::StatusOr<MeasurementSet> ParseMeasurementSet(absl::string_view csv, const std::string& origin,
                                                   const MeasurementLimits& limits = {});
absl::StatusOr<MeasurementSet> ReadMeasurementSet(const std::string& path);

}  // namespace touchstone::session
