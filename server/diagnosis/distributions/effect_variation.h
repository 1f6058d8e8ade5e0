// A model varied in one parameter of one effect, as the search for compatible effects does.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/model/model.h"

namespace touchstone::diagnosis::distributions {

// One number of one effect that is varied first.
struct EffectDirection {
  std::shared_ptr<const model::Effect> effect;
  int parameter = 0, entry = 0;
  int offset = 0;  // of the parameter in the effect's flat values
};

// Every number that says how strong an effect is, each finger's and each axis's.
std::vector<EffectDirection> DirectionsOf(const std::shared_ptr<const model::Effect>& effect, int fingers);

// Whether the effect can show in complete touches without poses: missed contacts cannot, "formula" without an
// expression changes nothing, and noise cannot be it where rounds already show the noise.
bool VisibleWithoutPoses(const model::Effect& effect, bool noise_is_known);

// The model with `amounts` (SI, one per entry) added to the direction's parameter; where its neutral value
// stands for infinity, they replace it. The effect is appended if the model lacks it. Null if a value would
// leave its bounds.
std::shared_ptr<const model::Model> Varied(const model::Model& model, const EffectDirection& direction,
                                           const std::vector<double>& amounts);

// "radius_mm = 1.5", "offset_mm changed by [1, -0.5, -0.5]", in the units of files.
std::string VariationInWords(const model::Model& model, const EffectDirection& direction,
                             const std::vector<double>& amounts);

}  // namespace touchstone::diagnosis::distributions
