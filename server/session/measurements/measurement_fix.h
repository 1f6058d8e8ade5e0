// Discrete mistakes of measurement files, fixed: columns in the wrong order, names exchanged, another unit, a frame
// that is turned. One transformation serves the check that looks for the mistake (diagnosis/checks/) and the command
// that fixes the file (`touchstone session fix`), so that what the one found is what the other does.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <Eigen/Core>

#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {

// What is wrong with a file, said as what it should have been. Done in the order of the fields.
struct MeasurementFix {
  // Only these touches are wrong, by their numbers, first and last; empty: all of the file. The other rows stay as
  // they are, and no time moves between them and these.
  std::vector<std::pair<uint64_t, uint64_t>> touches;
  bool plain_text = false;  // UTF-8, commas, decimal points, '-' for minus, ends of all lines (plain_csv.h)
  bool drop_duplicates = false;  // rows whose touch and times all repeat an earlier row's, digit for digit
  bool drop_stale = false;       // rows that RepeatsRow says to repeat the row before
  int shift_rows = 0;  // the times of row k belong to row k + shift_rows; rows that get none are dropped
  std::vector<int>
      finger_order;  // the file's i-th time column holds finger finger_order[i]; empty: as they are
  std::vector<std::pair<std::string, std::string>>
      rename_objects;  // from, to; all at once, so that two can swap
  double scale_times = 1;
  double scale_targets = 1;
  double scale_standoff = 1;
  double scale_speed = 1;
  // Each row has one entry of +1 or -1, each column too: new vector = axes * old one, of target, approach and lateral.
  std::optional<Eigen::Matrix3d> axes;
  bool reverse_approach = false;
  bool reverse_lateral = false;
  // The object stood there, seen from where the file says: its targets move by as much the other way.
  std::vector<std::pair<std::string, Eigen::Vector3d>> move_objects_m;

  bool empty() const;
};

// Whether a row holds the times of the one `lag` rows before, digit for digit: a reading that was not renewed. Rows of
// fewer than two times, or of equal ones, say nothing.
bool RepeatsRow(const MeasurementSet& set, int row, int lag);

// Fixes the set. Returns the rows of the old set that are left, in their order. Errors: an object or a finger that the
// set does not have, a factor that is not above 0, poses that the set does not have.
absl::StatusOr<std::vector<int>> ApplyFix(const MeasurementFix& fix, MeasurementSet* set);

// The options of `touchstone session fix` that do it: "--swap-fingers l,m". `fingers`: of the file.
std::string FixOptions(const MeasurementFix& fix, int fingers);

// Fixes the bytes of a measurement file. Fields that stay are copied byte for byte, and so are numbers that only move
// or change their sign.
absl::StatusOr<std::string> FixMeasurementFile(absl::string_view csv, const std::string& origin,
                                               const MeasurementFix& fix);

// "-y,x,z": the new x is the old -y. INVALID_ARGUMENT unless each axis stands once.
absl::StatusOr<Eigen::Matrix3d> ParseAxes(absl::string_view text);
std::string FormatAxes(const Eigen::Matrix3d& axes);

}  // namespace touchstone::session
