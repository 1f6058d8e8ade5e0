// The header line of a measurement file: which column holds what.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::session {

// What a field of a row is read into.
enum class ColumnKind {
  kTouch,
  kObject,
  kSpeed,
  kStandoff,
  kTarget,    // axis 0 to 2
  kApproach,  // axis 0 to 2
  kLateral,   // axis 0 to 2
  kTime,      // of finger `index`
  kSessionTime,
  kRound,
  kFace,
  kCovariate  // number `index` of Columns::covariates
};

struct Column {
  ColumnKind kind = ColumnKind::kTouch;
  int index = 0;  // axis, finger or number of the covariate
  std::string name;
};

struct Columns {
  std::vector<Column> all;  // in the file's order
  std::vector<std::string> covariates;
  int fingers = 0;  // 0: a plan
  bool has_touch = false;
  bool has_poses = false;
  bool has_session_time = false;
  bool has_round = false;
  bool has_face = false;
};

// Reads the header, whose fields are already apart. Errors name the origin, line 1 and the column.
absl::StatusOr<Columns> ReadColumns(const std::vector<std::string>& names, const std::string& origin);

// "cov_" and letters, digits and '_': a formula uses a covariate by its name.
bool IsCovariateName(absl::string_view name);

}  // namespace touchstone::session
