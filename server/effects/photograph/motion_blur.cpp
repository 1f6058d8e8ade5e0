// Motion blur: the camera or the object moves while the shutter is open.
//   light = mean of the light along a line of this length and direction through the pixel (0: right, 90 deg: up)
// In linear light. Displacements of several add up as vectors. The sign of the direction does not matter, so 180 deg more is the same.
#include <complex>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double length_px;
  double angle_rad;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::length_px, "length_px", Unit::kPixel, 0, 100, 0, 3,
     "How far the picture moves while the shutter is open."},
    {&Parameters::angle_rad, "angle_deg", Unit::kDegree, -180, 180, 0, 45,
     "Direction of the motion in the picture: 0 right, 90 up."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  if (p.length_px == 0) return;
  if (photo.motion_length_px == 0) {
    photo.motion_length_px = p.length_px;
    photo.motion_angle_rad = p.angle_rad;
    return;
  }
  const std::complex<double> motion =
      std::polar(photo.motion_length_px, photo.motion_angle_rad) + std::polar(p.length_px, p.angle_rad);
  photo.motion_length_px = std::abs(motion);
  photo.motion_angle_rad = std::arg(motion);
}

}  // namespace

model::Effect MotionBlur() {
  return DefineEffect<Parameters>({
      .name = "motion_blur",
      .stage = model::Stage::kImageSensor,
      .meaning = "The picture moves while the shutter is open.",
      .signature = "Edges across the direction of motion are smeared, edges along it stay sharp.",
      .check_on_rig = "Photograph with the arm at rest for some seconds: the blur disappears.",
      .remedy = "Wait until the arm has settled, or shorten the exposure.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
