// What holds for every effect of a photograph, as contract_test.cpp has it for touches.
#include <absl/strings/match.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <set>

#include "server/effects/all_effects.h"
#include "server/effects/photo_settings.h"

namespace touchstone::effects {
namespace {

// Settings that no field leaves at its neutral value, so that what an effect reads shows.
PhotoSettings SomeSettings() {
  PhotoSettings settings;
  settings.camera_offset_m = {0.001, 0.002, -0.003};
  settings.camera_rotation = Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  settings.focal_factor = 1.1;
  settings.principal_point_offset_px = {2, -1};
  settings.k1 = -0.1, settings.k2 = 0.02;
  settings.key_light_offset_m = {0.02, 0.01, -0.01};
  settings.ambient = 0.04;
  settings.specular_strength = 0.3, settings.specular_exponent = 12;
  settings.shadow_strength = 0.4;
  settings.background_light = 0.05;
  settings.vignetting = 0.1;
  settings.defocus_sigma_px = 0.7;
  settings.motion_length_px = 2, settings.motion_angle_rad = 0.3;
  settings.exposure_factor = 1.3;
  settings.gamma = 0.8;
  settings.black_level_grey = 3;
  settings.noise_sigma_grey = 1.5, settings.noise_gain = 0.02;
  return settings;
}

// The stages whose fields differ.
std::set<model::Stage> ChangedStages(const PhotoSettings& a, const PhotoSettings& b) {
  std::set<model::Stage> stages;
  if (a.camera_offset_m != b.camera_offset_m || a.camera_rotation != b.camera_rotation)
    stages.insert(model::Stage::kCameraPose);
  if (a.focal_factor != b.focal_factor || a.principal_point_offset_px != b.principal_point_offset_px ||
      a.k1 != b.k1 || a.k2 != b.k2)
    stages.insert(model::Stage::kProjection);
  if (a.key_light_offset_m != b.key_light_offset_m || a.ambient != b.ambient ||
      a.specular_strength != b.specular_strength || a.specular_exponent != b.specular_exponent ||
      a.shadow_strength != b.shadow_strength || a.background_light != b.background_light)
    stages.insert(model::Stage::kShading);
  if (a.vignetting != b.vignetting || a.defocus_sigma_px != b.defocus_sigma_px ||
      a.motion_length_px != b.motion_length_px || a.motion_angle_rad != b.motion_angle_rad ||
      a.exposure_factor != b.exposure_factor || a.gamma != b.gamma || a.srgb_share != b.srgb_share ||
      a.black_level_grey != b.black_level_grey || a.added_grey.size() != b.added_grey.size() ||
      a.noise_sigma_grey != b.noise_sigma_grey || a.noise_gain != b.noise_gain)
    stages.insert(model::Stage::kImageSensor);
  return stages;
}

std::vector<double> TypicalSi(const model::Effect& effect) {
  std::vector<double> values;
  for (const model::ParameterInfo& p : effect.parameters)
    values.insert(values.end(), p.Count(0), ToSi(p.unit, std::min(p.upper, p.neutral + p.typical)));
  return values;
}

class PhotoEffectContract : public testing::TestWithParam<std::shared_ptr<const model::Effect>> {
 protected:
  const model::Effect& effect() const { return *GetParam(); }
};

TEST_P(PhotoEffectContract, HasTextsForPeople) {
  for (const std::string& text :
       {effect().meaning, effect().signature, effect().check_on_rig, effect().remedy}) {
    EXPECT_GE(text.size(), 30u);
    EXPECT_TRUE(absl::EndsWith(text, ".")) << text;
  }
  for (const model::ParameterInfo& parameter : effect().parameters) EXPECT_GE(parameter.meaning.size(), 10u);
}

TEST_P(PhotoEffectContract, NamesEndInTheirUnit) {
  for (const model::ParameterInfo& p : effect().parameters) {
    EXPECT_TRUE(absl::EndsWith("_" + p.name, std::string(UnitSuffix(p.unit)))) << p.name;
    if (p.unit != Unit::kNone) continue;
    for (const char* suffix : {"_mm", "_deg", "_s", "_px", "_grey"})
      EXPECT_FALSE(absl::EndsWith(p.name, suffix)) << p.name << " has no unit";
  }
}

TEST_P(PhotoEffectContract, HasOrderedBoundsAroundItsNeutralValue) {
  EXPECT_FALSE(effect().parameters.empty());
  for (const model::ParameterInfo& p : effect().parameters) {
    EXPECT_LT(p.lower, p.upper) << p.name;
    EXPECT_GE(p.neutral, p.lower) << p.name;
    EXPECT_LT(p.neutral, p.upper) << p.name;
    EXPECT_GT(p.typical, 0) << p.name;
    EXPECT_LE(p.neutral + p.typical, p.upper) << p.name;
    EXPECT_NE(p.arity, model::Arity::kPerFinger) << p.name;
  }
}

TEST_P(PhotoEffectContract, ChangesNothingWithNeutralValues) {
  for (const PhotoSettings& before : {PhotoSettings(), SomeSettings()}) {
    PhotoSettings after = before;
    effect().apply_to_photo(effect().NeutralValues(3), after);
    EXPECT_THAT(ChangedStages(before, after), testing::IsEmpty());
  }
}

TEST_P(PhotoEffectContract, ChangesItsOwnStageOnly) {
  EXPECT_TRUE(effect().of_photos());
  for (const PhotoSettings& before : {PhotoSettings(), SomeSettings()}) {
    PhotoSettings after = before;
    effect().apply_to_photo(TypicalSi(effect()), after);
    EXPECT_THAT(ChangedStages(before, after), testing::ElementsAre(effect().stage));
  }
}

TEST_P(PhotoEffectContract, IsSystematicUnlessItIsNoise) {
  EXPECT_EQ(effect().random(), effect().name == "image_noise");
  EXPECT_FALSE(effect().moves_surface);
  EXPECT_FALSE(effect().before_cast);
}

TEST_P(PhotoEffectContract, NamesRivalsThatExistAndOnOneSideOnly) {
  for (const model::ConfoundedEffect& rival : effect().confounded_with) {
    EXPECT_GE(rival.discriminating_measurement.size(), 30u);
    if (rival.effect.empty()) continue;
    const auto other = Catalogue().Find(rival.effect);
    ASSERT_NE(other, nullptr) << rival.effect;
    EXPECT_NE(other->name, effect().name);
    for (const model::ConfoundedEffect& back : other->confounded_with)
      EXPECT_NE(back.effect, effect().name) << "declared on both sides, which may contradict each other";
  }
}

std::vector<std::shared_ptr<const model::Effect>> BuiltInPhotoEffects() {
  std::vector<std::shared_ptr<const model::Effect>> effects;
  for (const auto& effect : PhotoEffects())
    if (!effect->parameters.empty()) effects.push_back(effect);
  return effects;
}
INSTANTIATE_TEST_SUITE_P(Catalogue, PhotoEffectContract, testing::ValuesIn(BuiltInPhotoEffects()),
                         [](const auto& info) { return info.param->name; });

TEST(PhotoCatalogue, HasTheEffectsOfTheDesignInItsOrder) {
  std::vector<std::string> names;
  for (const auto& effect : BuiltInPhotoEffects()) names.push_back(effect->name);
  EXPECT_THAT(names, testing::ElementsAre("camera_translation", "camera_rotation", "focal_error",
                                          "principal_point", "radial_distortion", "light_position",
                                          "ambient_light", "specular", "cast_shadow", "background_level",
                                          "vignetting", "defocus_blur", "motion_blur", "exposure", "gamma",
                                          "response", "black_level", "image_noise"));
}

}  // namespace
}  // namespace touchstone::effects
