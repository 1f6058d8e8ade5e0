#include "server/effects/formula/pixel_variables.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "server/base/text/text.h"

namespace touchstone::effects {
namespace {

template <double PhotoPixel::*field>
double ReadPixel(const PhotoPixel& pixel) {
  return pixel.*field;
}

constexpr PixelVariable kPixelVariables[] = {
    {"radius", "", "distance from the principal point over half the image's diagonal",
     ReadPixel<&PhotoPixel::radius>},
    {"row", "px", "of the pixel's centre, from the upper edge", ReadPixel<&PhotoPixel::row>},
    {"column", "px", "of the pixel's centre, from the left edge", ReadPixel<&PhotoPixel::column>},
    {"grey", "grey", "recorded so far, 0 to 255", ReadPixel<&PhotoPixel::grey>},
    {"incidence_deg", "deg",
     "angle between the viewing ray and the inward surface normal; 90 on the background",
     ReadPixel<&PhotoPixel::incidence_deg>},
    {"depth_mm", "mm", "of the surface along the viewing axis; 0 on the background",
     ReadPixel<&PhotoPixel::depth_mm>},
    {"session_time_s", "s", "time since the session began", ReadPixel<&PhotoPixel::session_time_s>},
};

}  // namespace

absl::Span<const PixelVariable> PixelVariables() {
  return kPixelVariables;
}

const PixelVariable* FindPixelVariable(absl::string_view name) {
  for (const PixelVariable& variable : kPixelVariables)
    if (name == variable.name) return &variable;
  return nullptr;
}

absl::StatusOr<const PixelVariable*> FindPixelInput(absl::string_view kind, const std::string& name,
                                                    const std::vector<std::string>& also_known) {
  if (const PixelVariable* variable = FindPixelVariable(name); variable != nullptr) return variable;
  std::vector<std::string> known;
  for (const PixelVariable& variable : kPixelVariables) known.push_back(variable.name);
  const std::string variables = absl::StrJoin(known, ", ");
  known.insert(known.end(), also_known.begin(), also_known.end());
  return absl::InvalidArgumentError(absl::StrCat("unknown ", kind == "lookup" ? "covariate" : "variable",
                                                 " '", name, "'", DidYouMean(name, known),
                                                 "; what adds grey may use ", variables));
}

}  // namespace touchstone::effects
