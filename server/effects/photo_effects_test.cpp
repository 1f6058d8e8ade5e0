// What each effect of a photograph makes of the settings: its formula, in SI, with its signs, and what two of a kind do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/effects/all_effects.h"
#include "server/effects/photo_settings.h"
#include "server/model/model.h"

namespace touchstone::effects {
namespace {

using Lines = std::vector<std::pair<std::string, std::vector<std::string>>>;

PhotoSettings SettingsOf(const Lines& lines) {
  PhotoSettings settings;
  model::Model model = model::NominalModel();
  for (const auto& [effect, assignments] : lines) {
    const auto added = model::AddEffect(model::NominalModel(), effect, assignments, Catalogue());
    if (!added.ok()) {
      ADD_FAILURE() << added.status();
      continue;
    }
    added->effects[0].effect->apply_to_photo(added->effects[0].ValuesFor("any"), settings);
  }
  return settings;
}

TEST(CameraTranslation, MovesInTheCommandedAxesAndAddsUp) {
  const PhotoSettings settings = SettingsOf({{"camera_rotation", {"rotation_deg=0,0,90"}},
                                             {"camera_translation", {"offset_mm=1,2,3"}},
                                             {"camera_translation", {"offset_mm=10,0,0"}}});
  EXPECT_TRUE(settings.camera_offset_m.isApprox(Eigen::Vector3d(0.011, 0.002, 0.003)));
}

TEST(CameraRotation, TurnsByTheRightHandRuleEachInTheAxesOfTheOneBefore) {
  // About forward by 90 deg: the real camera's right is the commanded one's down.
  PhotoSettings settings = SettingsOf({{"camera_rotation", {"rotation_deg=0,0,90"}}});
  EXPECT_TRUE((settings.camera_rotation * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY()));
  // Then about its own right: what looks forward now looks to the commanded right.
  settings = SettingsOf(
      {{"camera_rotation", {"rotation_deg=0,0,90"}}, {"camera_rotation", {"rotation_deg=90,0,0"}}});
  EXPECT_TRUE((settings.camera_rotation * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitX(), 1e-9));
}

TEST(FocalError, Multiplies) {
  EXPECT_DOUBLE_EQ(SettingsOf({{"focal_error", {"relative=0.02"}}}).focal_factor, 1.02);
  EXPECT_DOUBLE_EQ(
      SettingsOf({{"focal_error", {"relative=0.1"}}, {"focal_error", {"relative=-0.1"}}}).focal_factor, 0.99);
}

TEST(PrincipalPoint, AddsUp) {
  const PhotoSettings settings =
      SettingsOf({{"principal_point", {"offset_px=3,-2"}}, {"principal_point", {"offset_px=0.5,1"}}});
  EXPECT_EQ(settings.principal_point_offset_px, Eigen::Vector2d(3.5, -1));
}

TEST(RadialDistortion, AddsItsCoefficients) {
  const PhotoSettings settings =
      SettingsOf({{"radial_distortion", {"k1=-0.25", "k2=0.125"}}, {"radial_distortion", {"k1=0.5"}}});
  EXPECT_EQ(settings.k1, 0.25);
  EXPECT_EQ(settings.k2, 0.125);
}

TEST(LightPosition, AddsUpInMetres) {
  const PhotoSettings settings =
      SettingsOf({{"light_position", {"offset_mm=10,20,-30"}}, {"light_position", {"offset_mm=1,0,0"}}});
  EXPECT_TRUE(settings.key_light_offset_m.isApprox(Eigen::Vector3d(0.011, 0.02, -0.03)));
}

TEST(AmbientLight, AddsUp) {
  EXPECT_DOUBLE_EQ(SettingsOf({{"ambient_light", {"level=0.1"}}, {"ambient_light", {"level=-0.05"}}}).ambient,
                   0.05);
}

TEST(Specular, WeighsExponentsByStrength) {
  EXPECT_EQ(SettingsOf({{"specular", {"strength=0.5", "exponent=40"}}}).specular_exponent, 40);
  const PhotoSettings two = SettingsOf(
      {{"specular", {"strength=0.25", "exponent=40"}}, {"specular", {"strength=0.75", "exponent=20"}}});
  EXPECT_EQ(two.specular_strength, 1);
  EXPECT_EQ(two.specular_exponent, 25);
  EXPECT_EQ(SettingsOf({{"specular", {"strength=0", "exponent=40"}}}).specular_strength, 0);
}

TEST(CastShadow, MultipliesWhatPasses) {
  EXPECT_DOUBLE_EQ(SettingsOf({{"cast_shadow", {"strength=0.4"}}}).shadow_strength, 0.4);
  EXPECT_DOUBLE_EQ(
      SettingsOf({{"cast_shadow", {"strength=0.4"}}, {"cast_shadow", {"strength=0.5"}}}).shadow_strength,
      0.7);
}

TEST(BackgroundLevel, IsAShareOfWhite) {
  EXPECT_DOUBLE_EQ(SettingsOf({{"background_level", {"grey=51"}}}).background_light, 0.2);
}

TEST(Vignetting, AddsUp) {
  EXPECT_DOUBLE_EQ(
      SettingsOf({{"vignetting", {"strength=0.1"}}, {"vignetting", {"strength=0.2"}}}).vignetting, 0.3);
}

TEST(DefocusBlur, AddsInQuadrature) {
  EXPECT_DOUBLE_EQ(
      SettingsOf({{"defocus_blur", {"sigma_px=3"}}, {"defocus_blur", {"sigma_px=4"}}}).defocus_sigma_px, 5);
}

TEST(MotionBlur, AddsDisplacements) {
  PhotoSettings settings = SettingsOf({{"motion_blur", {"length_px=3", "angle_deg=90"}}});
  EXPECT_EQ(settings.motion_length_px, 3);
  EXPECT_DOUBLE_EQ(settings.motion_angle_rad, kPi / 2);
  settings = SettingsOf(
      {{"motion_blur", {"length_px=3", "angle_deg=0"}}, {"motion_blur", {"length_px=3", "angle_deg=90"}}});
  EXPECT_DOUBLE_EQ(settings.motion_length_px, 3 * std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(settings.motion_angle_rad, kPi / 4);
}

TEST(Exposure, DoublesWithEveryStop) {
  EXPECT_EQ(SettingsOf({{"exposure", {"stops=2"}}}).exposure_factor, 4);
  EXPECT_EQ(SettingsOf({{"exposure", {"stops=2"}}, {"exposure", {"stops=-3"}}}).exposure_factor, 0.5);
}

TEST(Gamma, Multiplies) {
  EXPECT_DOUBLE_EQ(SettingsOf({{"gamma", {"exponent=0.5"}}, {"gamma", {"exponent=3"}}}).gamma, 1.5);
}

TEST(ImageNoise, AddsVariances) {
  const PhotoSettings settings = SettingsOf(
      {{"image_noise", {"sigma_grey=3", "gain=0.1"}}, {"image_noise", {"sigma_grey=4", "gain=0.2"}}});
  EXPECT_DOUBLE_EQ(settings.noise_sigma_grey, 5);
  EXPECT_DOUBLE_EQ(settings.noise_gain, 0.1 + 0.2);
}

}  // namespace
}  // namespace touchstone::effects
