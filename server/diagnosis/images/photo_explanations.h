// The explanations of photographs that are left after a diagnosis: what further pictures are to tell apart.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/images/pixel_noise.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::images {

// A fitted model that explains the photographs, and what people call it ("focal_error").
struct PhotoExplanation {
  std::string name;
  std::shared_ptr<const model::Model> model;
};

struct ExplanationsLeft {
  std::vector<PhotoExplanation> models;  // best first; one: nothing competes with it
  bool confounded = false;               // these photographs cannot tell the first two apart
  PixelNoise noise;                      // of what the best leaves
};

struct PhotoSelection;

// The explanation and what competes with the step that is hardest to tell from something else; else the explanation
// alone.
ExplanationsLeft FindExplanationsLeft(const PhotoSelection& selection);

}  // namespace touchstone::diagnosis::images
