// Background level: the ground behind the object is not black.
//   light of the background = grey / 255, linear, before everything that the image sensor does;  several add up
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double grey;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::grey, "grey", Unit::kGreyLevel, 0, 255, 0, 20,
     "Grey level of the ground at nominal exposure."},
};

void Apply(const Parameters& p, PhotoSettings& photo) {
  photo.background_light += p.grey / 255.0;
}

}  // namespace

model::Effect BackgroundLevel() {
  return DefineEffect<Parameters>({
      .name = "background_level",
      .stage = model::Stage::kShading,
      .meaning = "The ground behind the object gives light.",
      .signature = "Every pixel beside the object is brighter by the same amount; the object is as it was.",
      .check_on_rig = "Take a picture without the object.",
      .remedy = "Put black cloth behind the object, or keep the effect.",
      .rows = kRows,
      .apply_to_photo = Apply,
  });
}

}  // namespace touchstone::effects
