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

model::Model MustAdd(const std::string& effect, const std::vector<std::string>& assignments) {
  const auto model = model::AddEffect(model::NominalModel(), effect, assignments, Catalogue());
  if (model.ok()) return *model;
  ADD_FAILURE() << model.status();
  return {};
}
std::string ErrorOf(const std::string& effect, const std::vector<std::string>& assignments) {
  return std::string(
      model::AddEffect(model::NominalModel(), effect, assignments, Catalogue()).status().message());
}

TEST(GreyFormula, ReadsEveryVariableOfAPixelInTheUnitsOfFiles) {
  PhotoPixel pixel;
  pixel.radius = 0.5, pixel.row = 3, pixel.column = 7, pixel.grey = 100, pixel.incidence_deg = 40;
  pixel.depth_mm = 300, pixel.session_time_s = 60;
  const PhotoSettings settings = SettingsOf(
      {{"formula",
        {"name=mine", "adds=grey",
         "expression=k*radius + 10*row + 100*column + grey/1000 + incidence_deg*a/1e6 + depth_mm*1e-9 + "
         "session_time_s*1e-12",
         "k=2", "k_unit=grey", "k_min=0", "k_max=9", "a=3", "a_unit=deg", "a_min=0", "a_max=9"}}});
  ASSERT_EQ(settings.added_grey.size(), 1u);
  EXPECT_DOUBLE_EQ(settings.added_grey[0](pixel), 1 + 30 + 700 + 0.1 + 120e-6 + 300e-9 + 60e-12);
}

TEST(GreyLookup, IsLinearBetweenKnotsAndConstantBeyond) {
  const PhotoSettings settings = SettingsOf(
      {{"lookup", {"name=dirt", "adds=grey", "covariate=radius", "knots=0.2,0.6", "values=-4,8"}}});
  ASSERT_EQ(settings.added_grey.size(), 1u);
  for (const auto& [radius, expected] :
       {std::pair(0.0, -4.0), std::pair(0.3, -1.0), std::pair(0.5, 5.0), std::pair(0.9, 8.0)}) {
    PhotoPixel pixel;
    pixel.radius = radius;
    EXPECT_NEAR(settings.added_grey[0](pixel), expected, 1e-12);
  }
}

TEST(GreyTerms, ComeBackFromTheirFilesAndSayWhatChanged) {
  const model::Model formula = MustAdd("formula", {"name=glare", "adds=grey", "expression=k*radius^2", "k=4",
                                                   "k_unit=grey", "k_min=0", "k_max=9"});
  const model::Model lookup =
      MustAdd("lookup", {"name=dirt", "adds=grey", "covariate=row", "knots=0,100", "values=0,5"});
  for (const model::Model& model : {formula, lookup}) {
    EXPECT_EQ(model.effects[0].effect->stage, model::Stage::kImageSensor);
    EXPECT_TRUE(model.effects[0].effect->of_photos());
    EXPECT_FALSE(static_cast<bool>(model.effects[0].effect->apply));
    const std::string text = model::FormatModel(model);
    EXPECT_THAT(text, testing::HasSubstr("adds: grey"));
    EXPECT_THAT(text, testing::Not(testing::HasSubstr("stage")));
    const auto again = model::ParseModel(text, "again", Catalogue());
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->Hash(), model.Hash());
  }
  EXPECT_THAT(model::DiffModels(model::NominalModel(), formula),
              testing::ElementsAre(testing::HasSubstr("grey += k*radius^2")));
  EXPECT_THAT(model::DiffModels(model::NominalModel(), lookup),
              testing::ElementsAre(testing::HasSubstr("grey += curve of row")));
  // What is added is physics: the same expression as a travel is another model.
  const auto travel = model::AddEffect(
      model::NominalModel(), "lookup",
      {"name=dirt", "adds=travel_mm", "covariate=session_time_s", "knots=0,100", "values=0,5"}, Catalogue());
  const model::Model grey =
      MustAdd("lookup", {"name=dirt", "adds=grey", "covariate=session_time_s", "knots=0,100", "values=0,5"});
  EXPECT_NE(travel->Hash(), grey.Hash());
}

TEST(GreyTerms, RefuseWhatPhotographsDoNotHave) {
  EXPECT_THAT(
      ErrorOf("formula", {"name=a", "adds=grey", "expression=travel_mm"}),
      testing::AllOf(testing::HasSubstr("unknown variable 'travel_mm'"), testing::HasSubstr("radius, row")));
  EXPECT_THAT(ErrorOf("lookup", {"name=a", "adds=grey", "covariate=cov_heat", "knots=0,1", "values=0,1"}),
              testing::HasSubstr("unknown covariate 'cov_heat'"));
  EXPECT_THAT(ErrorOf("formula", {"name=a", "adds=travel_mm", "expression=radius"}),
              testing::HasSubstr("unknown variable 'radius'"));
  EXPECT_THAT(ErrorOf("formula", {"name=a", "adds=grey", "stage=sensor", "expression=radius"}),
              testing::HasSubstr("leave the stage out"));
  EXPECT_THAT(
      ErrorOf("lookup", {"name=a", "adds=grey", "covariate=row", "knots=0,1", "l=0,1", "m=0,1", "r=0,1"}),
      testing::HasSubstr("needs one list"));
  EXPECT_THAT(ErrorOf("formula", {"name=a", "adds=gray", "expression=radius"}),
              testing::HasSubstr("travel_mm, time_us or grey"));
  EXPECT_THAT(ErrorOf("formula", {"name=a", "adds=grey", "expression=row*2", "row=1", "row_unit=1",
                                  "row_min=0", "row_max=2"}),
              testing::HasSubstr("belongs to a variable"));
}

}  // namespace
}  // namespace touchstone::effects
