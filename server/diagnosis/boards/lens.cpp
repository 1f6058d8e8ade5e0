#include "server/diagnosis/boards/lens.h"

#include "server/effects/all_effects.h"
#include "server/effects/photo_settings.h"

namespace touchstone::diagnosis::boards {
namespace {

// A value of a nameless effect, and what it adds to: an entry of the lens, or a share of that entry.
struct NamelessValue {
  const char* effect;
  const char* name;
  double image::PhotoLens::*entry;
  bool is_share;
  double typical, bound;  // as of ParameterInfo
};
using Lens = image::PhotoLens;
constexpr NamelessValue kNamelessValues[] = {
    {"tangential distortion", "p1", &Lens::p1, false, 0.005, 1},
    {"tangential distortion", "p2", &Lens::p2, false, 0.005, 1},
    {"radial distortion of sixth order", "k3", &Lens::k3, false, 1, 100},
    {"pixels that are not square", "aspect", &Lens::fx, true, 0.01, 0.9},
};

}  // namespace

std::vector<std::shared_ptr<const model::Effect>> NamedLensEffects() {
  std::vector<std::shared_ptr<const model::Effect>> named;
  for (const auto& effect : effects::PhotoEffects())
    if (effect->stage == model::Stage::kProjection && !effect->random() && !effect->parameters.empty())
      named.push_back(effect);
  return named;
}

std::vector<std::shared_ptr<const model::Effect>> NamelessLensEffects() {
  std::vector<std::shared_ptr<model::Effect>> nameless;
  for (const NamelessValue& value : kNamelessValues) {
    if (nameless.empty() || nameless.back()->name != value.effect) {
      nameless.push_back(std::make_shared<model::Effect>());
      nameless.back()->name = value.effect;
      nameless.back()->stage = model::Stage::kProjection;
    }
    model::ParameterInfo& parameter = nameless.back()->parameters.emplace_back();
    parameter.name = value.name;
    parameter.lower = -value.bound;
    parameter.upper = value.bound;
    parameter.typical = value.typical;
  }
  return {nameless.begin(), nameless.end()};
}

model::Model WithEffectsOf(model::Model model, const model::Model& other) {
  model.effects.insert(model.effects.end(), other.effects.begin(), other.effects.end());
  return model;
}

image::PhotoLens LensOfModel(const session::CameraIntrinsics& nominal, const model::Model& model) {
  effects::PhotoSettings settings;
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->stage == model::Stage::kProjection && instance.effect->apply_to_photo)
      instance.effect->apply_to_photo(instance.values, settings);
  image::PhotoLens lens = image::EffectiveLens({nominal.width_px,
                                                nominal.height_px,
                                                nominal.fx_px,
                                                nominal.fy_px,
                                                nominal.cx_px,
                                                nominal.cy_px,
                                                {nominal.k1, nominal.k2, nominal.p1, nominal.p2, nominal.k3}},
                                               settings);
  for (const model::EffectInstance& instance : model.effects) {
    size_t k = 0;
    for (const NamelessValue& value : kNamelessValues)
      if (instance.effect->name == value.effect)
        lens.*value.entry += instance.values[k++] * (value.is_share ? lens.*value.entry : 1);
  }
  return lens;
}

}  // namespace touchstone::diagnosis::boards
