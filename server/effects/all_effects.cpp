#include "server/effects/all_effects.h"

#include "server/effects/contact/surface_map.h"
#include "server/effects/formula/formula.h"
#include "server/effects/formula/lookup.h"

// The built-in effects by stage, touches before photographs, in the order in which a stage applies and the catalogue lists them:
// one line each, the name of the function that its file exports. Registration by static objects is not used:
// the linker drops them from a static library.
#define TOUCHSTONE_TOUCH_EFFECTS(EFFECT) \
  /* pose */                             \
  EFFECT(ToolYaw)                        \
  EFFECT(ToolTilt)                       \
  EFFECT(FingerSpacing)                  \
  EFFECT(FingerLength)                   \
  EFFECT(GravitySag)                     \
  EFFECT(ObjectScale)                    \
  EFFECT(ObjectPose)                     \
  /* contact */                          \
  EFFECT(TipRadius)                      \
  EFFECT(SurfaceError)                   \
  EFFECT(SurfaceMap)                     \
  /* motion */                           \
  EFFECT(SpeedError)                     \
  EFFECT(AccelerationRamp)               \
  EFFECT(ContactSlowdown)                \
  EFFECT(ObjectPush)                     \
  /* sensor */                           \
  EFFECT(ObliqueSlip)                    \
  EFFECT(ChannelLatency)                 \
  EFFECT(ThermalDrift)                   \
  EFFECT(ReturnHysteresis)               \
  EFFECT(ClockSkew)                      \
  EFFECT(PollInterval)                   \
  EFFECT(GaussianNoise)                  \
  EFFECT(IncidenceNoise)                 \
  EFFECT(HeavyTailNoise)                 \
  EFFECT(MissedContact)                  \
  EFFECT(CorrelatedNoise)                \
  EFFECT(PositionNoise)                  \
  EFFECT(FingerNoise)

#define TOUCHSTONE_PHOTO_EFFECTS(EFFECT) \
  /* camera pose */                      \
  EFFECT(CameraTranslation)              \
  EFFECT(CameraRotation)                 \
  /* projection */                       \
  EFFECT(FocalError)                     \
  EFFECT(PrincipalPoint)                 \
  EFFECT(RadialDistortion)               \
  /* shading */                          \
  EFFECT(LightPosition)                  \
  EFFECT(AmbientLight)                   \
  EFFECT(Specular)                       \
  EFFECT(CastShadow)                     \
  EFFECT(BackgroundLevel)                \
  /* image sensor */                     \
  EFFECT(Vignetting)                     \
  EFFECT(DefocusBlur)                    \
  EFFECT(MotionBlur)                     \
  EFFECT(Exposure)                       \
  EFFECT(Gamma)                          \
  EFFECT(Response)                       \
  EFFECT(BlackLevel)                     \
  EFFECT(ImageNoise)

// Of any stage.
#define TOUCHSTONE_USER_EFFECTS(EFFECT) \
  EFFECT(Formula)                       \
  EFFECT(Lookup)

namespace touchstone::effects {

#define TOUCHSTONE_DECLARE(function) model::Effect function();
TOUCHSTONE_TOUCH_EFFECTS(TOUCHSTONE_DECLARE)
TOUCHSTONE_PHOTO_EFFECTS(TOUCHSTONE_DECLARE)
TOUCHSTONE_USER_EFFECTS(TOUCHSTONE_DECLARE)
#undef TOUCHSTONE_DECLARE

namespace {

class BuiltInCatalogue : public model::EffectCatalogue {
 public:
  BuiltInCatalogue() {
#define TOUCHSTONE_ADD(function) effects_.push_back(std::make_shared<const model::Effect>(function()));
    TOUCHSTONE_TOUCH_EFFECTS(TOUCHSTONE_ADD)
    TOUCHSTONE_PHOTO_EFFECTS(TOUCHSTONE_ADD)
    TOUCHSTONE_USER_EFFECTS(TOUCHSTONE_ADD)
#undef TOUCHSTONE_ADD
  }

  std::vector<std::shared_ptr<const model::Effect>> All() const override {
    return effects_;
  }

  std::shared_ptr<const model::Effect> Find(const std::string& name) const override {
    for (const auto& effect : effects_)
      if (effect->name == name) return effect;
    return nullptr;
  }

  absl::StatusOr<std::shared_ptr<const model::Effect>> MakeFormula(
      const model::FormulaSpec& spec) const override {
    return MakeFormulaEffect(spec);
  }

  absl::StatusOr<std::shared_ptr<const model::Effect>> MakeLookup(
      const model::LookupSpec& spec) const override {
    return MakeLookupEffect(spec);
  }

  absl::StatusOr<std::shared_ptr<const model::Effect>> MakeSurfaceMap(
      const model::SurfaceMapSpec& spec) const override {
    return MakeSurfaceMapEffect(spec);
  }

 private:
  std::vector<std::shared_ptr<const model::Effect>> effects_;
};

std::vector<std::shared_ptr<const model::Effect>> EffectsOf(bool photos) {
  std::vector<std::shared_ptr<const model::Effect>> effects;
  for (const auto& effect : Catalogue().All())
    if (effect->of_photos() == photos) effects.push_back(effect);
  return effects;
}

}  // namespace

const model::EffectCatalogue& Catalogue() {
  static const BuiltInCatalogue& catalogue = *new BuiltInCatalogue;
  return catalogue;
}

const std::vector<std::shared_ptr<const model::Effect>>& TouchEffects() {
  static const auto& effects = *new std::vector<std::shared_ptr<const model::Effect>>(EffectsOf(false));
  return effects;
}

const std::vector<std::shared_ptr<const model::Effect>>& PhotoEffects() {
  static const auto& effects = *new std::vector<std::shared_ptr<const model::Effect>>(EffectsOf(true));
  return effects;
}

std::shared_ptr<const model::Effect> FindByRole(model::EffectRole role) {
  for (const auto& effect : Catalogue().All())
    if (effect->role == role) return effect;
  return nullptr;
}

}  // namespace touchstone::effects
