// Response: the camera writes sRGB's curve instead of linear light (IEC 61966-2-1).
//   recorded = 12.92 light up to 0.0031308, else 1.055 light^(1/2.4) - 0.055;  after gamma
#include <algorithm>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double curve;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {.field = &Parameters::curve,
     .name = "curve",
     .unit = Unit::kNone,
     .lower = 0,
     .upper = 1,
     .neutral = 0,
     .typical = 1,
     .meaning = "The curve that the camera writes: linear or srgb.",
     .choices = "linear,srgb"},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.srgb_share = std::min(photo.srgb_share + p.curve, 1.0);
}

}  // namespace

model::Effect Response() {
  return DefineEffect<Parameters>({
      .name = "response",
      .stage = model::Stage::kImageSensor,
      .meaning = "The camera writes its pictures for screens, with sRGB's curve, and not as linear light.",
      .signature =
          "Dark and middle greys are far too bright (a light of 0.2 reads 124); black and white stay.",
      .check_on_rig =
          "Double the shutter time: levels that grow by a third to a half and do not double show the curve.",
      .remedy = "Record raw or linear pictures, undo the curve before they are used, or keep the effect.",
      .confounded_with =
          {
              {"gamma",
               "Photograph a wedge of grey steps: sRGB is straight near black, a power of the light is steep "
               "there."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
