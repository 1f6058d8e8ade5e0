#include "server/diagnosis/images/diagnose_photographs.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <set>
#include <string>
#include <string_view>

#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/engine/uniform_p_values.h"
#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::images {
namespace {

PhotographDiagnosis Diagnosed(const DiagnosisInput& input) {
  ThreadPool pool(2);
  DiagnosisContext context;
  context.pool = &pool;
  const absl::StatusOr<PhotographDiagnosis> diagnosis = DiagnosePhotographs(input, context);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  if (!diagnosis.ok()) return {};
  std::cout << "verdict " << static_cast<int>(diagnosis->verdict) << ", floor "
            << diagnosis->noise_floor.sigma << ", rmse " << diagnosis->initial->rmse << " -> "
            << (diagnosis->final ? diagnosis->final->rmse : 0) << ", p "
            << (diagnosis->final ? diagnosis->final->lack_of_fit_p : 0) << ", " << diagnosis->duration_s
            << " s\n";
  for (const engine::LadderStep& step : diagnosis->steps) {
    std::cout << "  + " << step.effect << " " << step.probability << " gain " << step.gain_nats;
    for (const auto& e : step.parameters)
      std::cout << "  " << e.object << " " << e.name << e.entry << " = " << e.value << " +- " << e.std_error;
    for (const std::string& other : step.equivalent) std::cout << " or " << other;
    std::cout << "\n";
  }
  for (const auto& refit : diagnosis->refitted) {
    std::cout << "  refit " << refit.effect;
    for (const auto& e : refit.parameters)
      std::cout << "  " << e.name << e.entry << " = " << e.value << " +- " << e.std_error;
    std::cout << "\n";
  }
  if (diagnosis->unexplained) {
    std::cout << "  unexplained: " << diagnosis->unexplained->words << "\n";
    for (const auto& c : diagnosis->unexplained->covariates)
      std::cout << "    " << c.name << " p " << c.p << "\n";
  }
  return *diagnosis;
}

TEST(DiagnosePhotographs, FindsNothingWhereNothingIsMissing) {
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput({}));
  EXPECT_EQ(d.verdict, engine::Verdict::kAdequate);
  EXPECT_TRUE(d.steps.empty());
  ASSERT_TRUE(d.nothing_missing);
  EXPECT_GT(d.nothing_missing->p, 0.01);
  EXPECT_GT(d.nothing_missing->hypotheses, 20);
}

TEST(DiagnosePhotographs, HasAUniformPOfNothingMissingWhereNothingIs) {
  TOUCHSTONE_SECOND_TIER("statistical: 60 sets of pictures");
  std::vector<double> p;
  for (uint64_t seed = 100; seed < 160; ++seed) {
    HiddenCamera rig;
    rig.seed = seed;
    p.push_back(Diagnosed(MakePhotoInput(rig)).nothing_missing->p);
  }
  engine::ExpectUniform(p);
}

TEST(DiagnosePhotographs, DoesNotSayOfAFewPicturesWhetherNothingIsMissing) {
  HiddenCamera rig;
  rig.objects = {"lat00"};
  rig.photographs = 7;
  EXPECT_FALSE(Diagnosed(MakePhotoInput(rig)).nothing_missing);
}

TEST(DiagnosePhotographs, SaysWhatAPixelIsPredictedWith) {
  HiddenCamera rig;
  rig.hidden = {{"exposure", {"stops=0.4"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  ASSERT_EQ(d.steps.size(), 1u) << d.summary;
  EXPECT_LT(d.nothing_missing->p, 1e-6);
  ASSERT_EQ(d.uncertainty.size(), d.objects.size() + 1);
  const uncertainty::Budget& all = d.uncertainty.back();
  EXPECT_EQ(all.object, "");
  EXPECT_GT(all.touches, 0);
  EXPECT_EQ(all.repeatability, d.noise_floor.sigma);
  // Light times 2^stops: a pixel's grey level changes by ln 2 times itself with a stop; the ground has a level of its own.
  const auto exposure = std::find_if(all.contributions.begin(), all.contributions.end(),
                                     [](const auto& one) { return one.name == "exposure"; });
  ASSERT_NE(exposure, all.contributions.end());
  const double error_stops = d.steps[0].parameters[0].std_error;
  EXPECT_GT(exposure->std_uncertainty, 10 * std::log(2) * error_stops);
  EXPECT_LT(exposure->std_uncertainty, 255 * std::log(2) * error_stops);
  EXPECT_GE(all.combined, all.repeatability);
  EXPECT_GE(all.largest, all.combined);
}

// Twenty sets: a minute.
TEST(DiagnosePhotographs, DISABLED_FindsNothingInManySetsWhereNothingIsMissing) {
  for (uint64_t seed = 100; seed < 120; ++seed) {
    HiddenCamera rig;
    rig.seed = seed;
    rig.sigma_grey = seed % 2 == 0 ? 1 : 3;
    EXPECT_EQ(Diagnosed(MakePhotoInput(rig)).verdict, engine::Verdict::kAdequate) << seed;
  }
}

TEST(DiagnosePhotographs, NamesNothingWhereTheLensIsDirty) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.unlisted = [](int, int column, int row, const image::Photo& photo, size_t) {
    const double x = (column - 0.65 * photo.width) / (0.12 * photo.width),
                 y = (row - 0.4 * photo.height) / (0.12 * photo.height);
    return 8 * std::exp(-0.5 * (x * x + y * y));
  };
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kUnexplained);
  EXPECT_TRUE(d.steps.empty());
}

// Alone, the exposure takes most of the error: the dirt beside it must not hide it.
TEST(DiagnosePhotographs, NamesALargeExposureBesideDirt) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.hidden = {{"exposure", {"stops=0.15"}}};
  rig.unlisted = [](int, int column, int row, const image::Photo& photo, size_t pixel) {
    const double x = (column - 0.65 * photo.width) / (0.07 * photo.width),
                 y = (row - 0.4 * photo.height) / (0.07 * photo.height);
    return x * x + y * y < 1 ? -0.2 * photo.grey[pixel] : 0.0;
  };
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kUnexplained);
  ASSERT_EQ(d.steps.size(), 1u);
  EXPECT_EQ(d.steps[0].effect, "exposure");
  EXPECT_LE(d.steps[0].probability, 0.9);
  EXPECT_LT(d.steps[0].quality.rmse, d.initial->rmse);
  EXPECT_NEAR(d.steps[0].quality.rmse, d.final->rmse, 0.01);
}

TEST(DiagnosePhotographs, NamesNothingWhereTheSurfaceIsPatchy) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.unlisted = [](int, int, int, const image::Photo& photo, size_t pixel) {
    if (!photo.mask[pixel]) return 0.0;
    const Eigen::Vector3f& p = photo.point_m[pixel];
    return 0.03 * photo.grey[pixel] *
           (std::sin(130 * p.x() + 1) + std::sin(110 * p.y()) + std::sin(150 * p.z() + 2));
  };
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_TRUE(d.steps.empty());
  EXPECT_EQ(d.verdict, engine::Verdict::kUnexplained);
}

TEST(DiagnosePhotographs, NamesNothingWhereTheLightFlickers) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.unlisted = [](int photograph, int, int, const image::Photo& photo, size_t pixel) {
    RandomStream random(5, RandomDomain::kTest, photograph);
    return 0.02 * random.Normal() * photo.grey[pixel];
  };
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_TRUE(d.steps.empty());
  EXPECT_EQ(d.verdict, engine::Verdict::kUnexplained);
}

// Each of the three hides what the others take from the error: the search takes them on trial, and goes on where they lead.
TEST(DiagnosePhotographs, FindsAWrongCameraFileBesideExposureAndLens) {
  TOUCHSTONE_SECOND_TIER("long: whole diagnoses of pictures");
  const std::vector<NamedValues> cameras = {{{"focal_error", {"relative=-0.04"}}},
                                            {{"focal_error", {"relative=0.1"}}},
                                            {{"principal_point", {"offset_px=-15,0"}}},
                                            {{"principal_point", {"offset_px=5,20"}}}};
  for (const NamedValues& camera : cameras) {
    HiddenCamera rig;
    rig.photographs = 6;
    rig.side_px = 112;
    rig.hidden = {camera[0], {"exposure", {"stops=0.25"}}, {"radial_distortion", {"k1=-0.15"}}};
    const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
    EXPECT_EQ(d.verdict, engine::Verdict::kMissingEffects);
    std::set<std::string> found;
    for (const engine::LadderStep& step : d.steps) found.insert(step.effect);
    EXPECT_EQ(found, (std::set<std::string>{camera[0].first, "exposure", "radial_distortion"}));
    EXPECT_LT(d.final->rmse, 1.1 * d.noise_floor.sigma);
  }
}

// With a part of the explanation the error rises; each of these steps takes most of it on top of all others.
TEST(DiagnosePhotographs, KeepsAStepThatNeedsThoseBehindIt) {
  TOUCHSTONE_SECOND_TIER("long: whole diagnoses of pictures");
  const std::vector<NamedValues> cameras = {
      {{"principal_point", {"offset_px=-30,0"}}},
      {{"principal_point", {"offset_px=-15,0"}}, {"focal_error", {"relative=-0.0385"}}}};
  for (const NamedValues& camera : cameras) {
    HiddenCamera rig;
    rig.side_px = 224;
    rig.hidden = {{"exposure", {"stops=0.25"}}, {"radial_distortion", {"k1=-0.15"}}};
    rig.hidden.insert(rig.hidden.end(), camera.begin(), camera.end());
    const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
    EXPECT_EQ(d.verdict, engine::Verdict::kMissingEffects);
    EXPECT_EQ(d.steps.size(), rig.hidden.size());
  }
}

TEST(DiagnosePhotographs, NamesBothOfAPair) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.hidden = {{"camera_rotation", {"rotation_deg=0.3,-0.2,0.4"}}, {"exposure", {"stops=0.15"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(d.steps.size(), 2u);
  // Half of the explanation fits nothing, even where what is left shows at contours alone.
  EXPECT_GT(d.steps[0].quality.rmse, 1.2 * d.noise_floor.sigma);
  EXPECT_LT(d.steps[0].quality.lack_of_fit_p, 1e-6);
  // Each step's own unseen error, not that of the whole explanation.
  EXPECT_GE(d.steps[0].quality.heldout_rmse, d.steps[0].quality.rmse);
  EXPECT_GE(d.final->heldout_rmse, d.final->rmse);
  EXPECT_LT(d.final->heldout_rmse, 1.1 * d.final->rmse);
  EXPECT_GT(d.final->lack_of_fit_p, 1e-3);
}

// Smooth albedo holds nearly all of an exposure: beside it the lens's share of the error is small, and the whole
// set of both was once called UNEXPLAINED.
TEST(DiagnosePhotographs, NamesALensBesideAnExposureThatAlbedoCouldHold) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.photographs = 6;
  rig.side_px = 112;
  rig.hidden = {{"radial_distortion", {"k1=-0.18", "k2=0.035"}}, {"exposure", {"stops=0.4"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(d.steps.size(), 2u);
  const bool lens_first = d.steps[0].effect == "radial_distortion";
  EXPECT_EQ(d.steps[0].effect, lens_first ? "radial_distortion" : "exposure");
  EXPECT_EQ(d.steps[1].effect, lens_first ? "exposure" : "radial_distortion");
  // Before a black ground, objects that reflect more look the same.
  ASSERT_EQ(d.confounded.size(), 1u);
  EXPECT_EQ(d.confounded[0].effects[0], "exposure");
  EXPECT_NE(d.confounded[0].discriminating_measurement.find("card of known reflectance"), std::string::npos);
}

TEST(DiagnosePhotographs, TellsAnExposureFromAlbedoWhereTheGroundIsLitOrSurfacesShine) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  const std::vector<NamedValues> grounds = {{{"background_level", {"grey=40"}}},
                                            {{"specular", {"strength=0.4", "exponent=20"}}}};
  for (const auto& known : grounds) {
    HiddenCamera rig;
    rig.photographs = 6;
    rig.side_px = 112;
    rig.known = known;
    rig.hidden = {{"exposure", {"stops=0.3"}}};
    const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
    ASSERT_EQ(d.steps.size(), 1u);
    EXPECT_EQ(d.steps[0].effect, "exposure");
    EXPECT_TRUE(d.confounded.empty());
  }
}

// Black is 0.8 grey levels of clipped and rounded noise, not light of the ground.
TEST(DiagnosePhotographs, FindsTheFaintLightOfABlackGround) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.hidden = {{"background_level", {"grey=0.2"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  ASSERT_EQ(d.steps.size(), 1u);
  EXPECT_EQ(d.steps[0].effect, "background_level");
  const engine::ParameterEstimate& grey = d.steps[0].parameters[0];
  EXPECT_NEAR(grey.value, 0.2, 3.5 * grey.std_error);
  EXPECT_LT(grey.std_error, 0.025);  // with what contours leave in doubt
}

TEST(DiagnosePhotographs, NamesAPoseThatDiffersFromObjectToObject) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.hidden_on["lat00"] = {{"object_pose", {"translation_mm=1,0.5,0", "rotation_deg=0,0,1"}}};
  rig.hidden_on["lat10"] = {{"object_pose", {"translation_mm=-0.5,1,0", "rotation_deg=0,0,-0.5"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  ASSERT_EQ(d.steps.size(), 1u);
  EXPECT_EQ(d.steps[0].effect, "object_pose");
}

TEST(DiagnosePhotographs, NamesACameraThatWasTurnedForOneObject) {
  HiddenCamera rig;
  rig.photographs = 5;
  rig.hidden_on["lat20"] = {{"camera_rotation", {"rotation_deg=0,0,0.8"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(d.steps.size(), 1u);
  EXPECT_EQ(d.steps[0].effect, "camera_rotation");
  ASSERT_EQ(d.steps[0].parameters.size(), 3u);
  EXPECT_EQ(d.steps[0].parameters[2].object, "lat20");
  EXPECT_NEAR(d.steps[0].parameters[2].value, 0.8, 0.1);
}

// Where no test of single covariates sees it among so few pictures.
TEST(DiagnosePhotographs, NamesWhatItsFormulaFollows) {
  HiddenCamera rig;
  rig.photographs = 5;
  rig.unlisted = [](int photograph, int, int, const image::Photo& photo, size_t pixel) {
    return -0.2 * photograph / 15.0 * photo.grey[pixel];
  };
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(d.unexplained);
  EXPECT_NE(d.unexplained->formula.find("session_time_s"), std::string::npos) << d.unexplained->formula;
  ASSERT_FALSE(d.unexplained->covariates.empty());
  EXPECT_EQ(d.unexplained->covariates[0].name, "session_time_s");
  EXPECT_LT(d.unexplained->covariates[0].p, 1e-4);
  ASSERT_TRUE(d.nothing_missing);
  EXPECT_LT(d.nothing_missing->p, 0.01);
}

TEST(DiagnosePhotographs, GivesAnEffectOfTheModelItsRightValue) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of pictures");
  HiddenCamera rig;
  rig.known = {{"exposure", {"stops=0.2"}}};
  DiagnosisInput input = MakePhotoInput(rig);
  input.model = std::make_shared<const model::Model>(WithPhotoEffects(
      model::NominalModel(), {{"image_noise", {"sigma_grey=2"}}, {"exposure", {"stops=0.1"}}}));
  const PhotographDiagnosis d = Diagnosed(input);
  EXPECT_EQ(d.verdict, engine::Verdict::kWrongValues);
  ASSERT_EQ(d.refitted.size(), 1u);
  EXPECT_NEAR(d.refitted[0].parameters[0].value, 0.2, 0.002);
}

TEST(DiagnosePhotographs, DISABLED_IsDoneInTwentySeconds) {
  HiddenCamera rig;
  rig.objects = {"lat00", "lat05", "lat10", "lat15", "lat20"};
  rig.photographs = 20;
  rig.side_px = 224;
  rig.hidden = {{"radial_distortion", {"k1=0.05"}}, {"exposure", {"stops=0.15"}}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.steps.size(), 2u);
  EXPECT_LT(d.duration_s, 20);
}

struct Hidden {
  const char* effect;
  std::vector<std::string> values;
};

class OneHidden : public ::testing::TestWithParam<Hidden> {};

TEST_P(OneHidden, IsNamedWithItsValue) {
  static const std::set<std::string> kOfEachStage = {"camera_rotation", "radial_distortion", "cast_shadow",
                                                     "gamma"};
  if (kUnderSanitizers && kOfEachStage.count(GetParam().effect) == 0)
    GTEST_SKIP() << "under sanitizers one effect of each stage is enough";
  if (const std::string_view effect = GetParam().effect; effect != "exposure" && effect != "gamma")
    TOUCHSTONE_SECOND_TIER("repeated: every effect of photographs, hidden one at a time");
  HiddenCamera rig;
  rig.hidden = {{GetParam().effect, GetParam().values}};
  const PhotographDiagnosis d = Diagnosed(MakePhotoInput(rig));
  EXPECT_EQ(d.verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(d.steps.size(), 1u);
  EXPECT_EQ(d.steps[0].effect, GetParam().effect);
  // Each value within three standard errors, and a pixel's share for what contours tell.
  for (const engine::ParameterEstimate& e : d.steps[0].parameters) {
    double hidden = 0;
    for (const std::string& text : GetParam().values) {
      const std::vector<std::string> parts = absl::StrSplit(text, '=');
      if (parts[0] != e.name) continue;
      if (parts[1] == "srgb") {
        hidden = 1;
        continue;
      }
      const std::vector<std::string> entries = absl::StrSplit(parts[1], ',');
      EXPECT_TRUE(absl::SimpleAtod(entries[e.entry.empty() ? 0 : e.entry[0] - 'x'], &hidden));
    }
    EXPECT_NEAR(e.value, hidden, 3 * e.std_error) << e.name << e.entry;
  }
  // Contours are sharp here: where one is off by a hundredth of a pixel, one pixel in a hundred along it is.
  EXPECT_LT(d.final->rmse, 1.15 * d.noise_floor.sigma);
}

INSTANTIATE_TEST_SUITE_P(
    Photographs, OneHidden,
    ::testing::Values(
        Hidden{"exposure", {"stops=0.1"}}, Hidden{"focal_error", {"relative=0.01"}},
        Hidden{"radial_distortion", {"k1=0.05"}}, Hidden{"camera_rotation", {"rotation_deg=0.2,-0.3,0.4"}},
        Hidden{"camera_translation", {"offset_mm=1,-2,0.5"}}, Hidden{"principal_point", {"offset_px=2,-1"}},
        Hidden{"gamma", {"exponent=1.1"}}, Hidden{"vignetting", {"strength=0.2"}},
        Hidden{"defocus_blur", {"sigma_px=0.8"}}, Hidden{"motion_blur", {"length_px=3", "angle_deg=60"}},
        Hidden{"light_position", {"offset_mm=20,0,-10"}}, Hidden{"ambient_light", {"level=0.04"}},
        Hidden{"cast_shadow", {"strength=0.4"}}, Hidden{"specular", {"strength=0.2", "exponent=30"}},
        Hidden{"background_level", {"grey=12"}}, Hidden{"black_level", {"grey=12"}},
        Hidden{"response", {"curve=srgb"}},
        Hidden{"object_pose", {"translation_mm=1,-1,0.5", "rotation_deg=0.3,0,-0.5"}},
        Hidden{"object_scale", {"relative=0.01"}}),
    [](const auto& info) { return std::string(info.param.effect); });

}  // namespace
}  // namespace touchstone::diagnosis::images
