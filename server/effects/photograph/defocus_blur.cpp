// Defocus blur: the object is out of focus.
//   light = light convolved with a Gaussian of standard deviation sigma, sampled at pixels;  sigmas of several add in quadrature
// In linear light. Below about 0.3 px a sampled Gaussian is a point and changes nothing.
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double sigma_px;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::sigma_px, "sigma_px", Unit::kPixel, 0, 30, 0, 0.8, "Standard deviation of the blur."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.defocus_sigma_px = std::hypot(photo.defocus_sigma_px, p.sigma_px);
}

}  // namespace

model::Effect DefocusBlur() {
  return DefineEffect<Parameters>({
      .name = "defocus_blur",
      .stage = model::Stage::kImageSensor,
      .meaning = "The picture is out of focus, alike in all directions.",
      .signature =
          "Bright rims outside silhouettes and dark ones inside, of the same width in every direction.",
      .check_on_rig = "Photograph a sharp edge and look over how many pixels it rises.",
      .remedy = "Focus on the object, close the aperture, or keep the effect.",
      .confounded_with =
          {
              {"motion_blur",
               "Compare horizontal and vertical edges: motion blurs only those across its direction."},
          },
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
