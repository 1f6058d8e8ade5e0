// The header line of images.csv: which column holds what.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/session/images/images_csv.h"

namespace touchstone::session {

enum class ImageColumnKind {
  kImage,
  kFile,
  kObject,
  kCommanded,  // part `index` of a placement: eye x y z, at x y z, up x y z
  kMeasured,   // the same
  kSessionTime,
  kRound,
  kTouch,
  kCovariate
};

struct ImageColumn {
  ImageColumnKind kind = ImageColumnKind::kImage;
  int index = 0;
  std::string name;
};

inline constexpr int kPlacementParts = 9;
// "eye_x_mm", ..., "up_z".
extern const char* const kPlacementNames[kPlacementParts];
// Whether a part is a length (of eye and at) and not a number (of up).
inline bool IsLength(int part) {
  return part < 6;
}
inline constexpr char kMeasuredPrefix[] = "measured_";

// Reads the header, whose fields are already apart. Errors name the origin, line 1 and the column.
absl::StatusOr<std::vector<ImageColumn>> ReadImageColumns(const std::vector<std::string>& names,
                                                          const std::string& origin);

}  // namespace touchstone::session
