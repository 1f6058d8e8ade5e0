#include "server/diagnosis/images/pixels/image_field.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/diagnosis/images/pixels/rules.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr int kMaxHalfWaves = 6;  // across and down together

}  // namespace

std::shared_ptr<const model::Effect> ImageFieldEffect() {
  static const std::shared_ptr<const model::Effect> effect = [] {
    auto field = std::make_shared<model::Effect>();
    field->name = kImageFieldName;
    field->stage = model::Stage::kImageSensor;
    field->meaning = "Something that is the same in every picture and smooth across it.";
    for (int i = 0; i < kImageFieldSize; ++i) {
      model::ParameterInfo parameter;
      parameter.name = absl::StrCat("wave", i, "_grey");
      parameter.unit = Unit::kGreyLevel;
      parameter.lower = -kPixelRules.field_max_grey;
      parameter.upper = kPixelRules.field_max_grey;
      parameter.typical = kPixelRules.field_typical_grey;
      field->parameters.push_back(parameter);
    }
    field->apply_to_photo = [](absl::Span<const double>, effects::PhotoSettings&) {};
    return field;
  }();
  return effect;
}

int IndexOfImageField(const model::Model& model) {
  for (size_t index = 0; index < model.effects.size(); ++index)
    if (model.effects[index].effect->name == kImageFieldName) return static_cast<int>(index);
  return -1;
}

model::Model WithoutImageField(model::Model model) {
  if (const int index = IndexOfImageField(model); index >= 0)
    model.effects.erase(model.effects.begin() + index);
  return model;
}

Eigen::MatrixXf ImageFieldFunctions(int width, int height) {
  // Waves of one direction, a column each.
  const auto waves_along = [](int pixels) {
    Eigen::MatrixXf waves(pixels, kMaxHalfWaves + 1);
    for (int k = 0; k <= kMaxHalfWaves; ++k)
      for (int x = 0; x < pixels; ++x)
        waves(x, k) = static_cast<float>(std::cos(M_PI * k * (x + 0.5) / pixels));
    return waves;
  };
  const Eigen::MatrixXf across_waves = waves_along(width), down_waves = waves_along(height);
  Eigen::MatrixXf functions(static_cast<Eigen::Index>(width) * height, kImageFieldSize);
  int column = 0;
  for (int waves = 0; waves <= kMaxHalfWaves; ++waves)
    for (int across = 0; across <= waves; ++across, ++column)
      for (int y = 0; y < height; ++y)
        functions.col(column).segment(static_cast<Eigen::Index>(y) * width, width) =
            down_waves(y, waves - across) * across_waves.col(across);
  return functions;
}

}  // namespace touchstone::diagnosis::images
