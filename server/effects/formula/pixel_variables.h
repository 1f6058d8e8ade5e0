// What formulas and lookups that add grey may read of one pixel of a photograph.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <absl/types/span.h>

#include "server/effects/photo_settings.h"

namespace touchstone::effects {

// One variable, in the unit of files.
struct PixelVariable {
  const char* name;
  const char* unit;  // "mm", "deg", ...; empty: a plain number
  const char* meaning;
  double (*read)(const PhotoPixel& pixel);
};
absl::Span<const PixelVariable> PixelVariables();
const PixelVariable* FindPixelVariable(absl::string_view name);  // null if there is none

// The same, with an error that names what is known. `kind`: "formula" or "lookup".
absl::StatusOr<const PixelVariable*> FindPixelInput(absl::string_view kind, const std::string& name,
                                                    const std::vector<std::string>& also_known);

}  // namespace touchstone::effects
