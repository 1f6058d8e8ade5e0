// The nameless competitor of the camera's effects: grey levels that are the same in every picture and smooth across it
// (dirt on the lens, a reflection). It takes part in a search like any effect; where it is what fits, nothing is named.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "server/diagnosis/images/pixels/photo_cells.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::images {

inline constexpr char kImageFieldName[] = "image_field";
inline constexpr int kImageFieldSize = 28;

// An effect of no model file: the simulation of photographs does nothing for it, PhotoRows adds it.
std::shared_ptr<const model::Effect> ImageFieldEffect();

// Its place among a model's effects; -1: the model has none.
int IndexOfImageField(const model::Model& model);
model::Model WithoutImageField(model::Model model);

// The functions that its values (grey levels) multiply, a column each. [pixel]
Eigen::MatrixXf ImageFieldFunctions(int width, int height);

}  // namespace touchstone::diagnosis::images
