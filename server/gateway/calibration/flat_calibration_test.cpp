#include "server/gateway/calibration/flat_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/base/numbers/nan.h"
#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"

namespace touchstone::gateway::calibration {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kSpacingM = 0.03;

std::vector<FlatTouch> Touches(size_t count, const std::vector<double>& offset_m, double sigma_s,
                               const std::vector<double>& speeds_m_s, RandomStream* random) {
  std::vector<FlatTouch> touches(count);
  for (size_t k = 0; k < count; ++k) {
    touches[k].speed_m_s = speeds_m_s[k % speeds_m_s.size()];
    const double start_s = random->Uniform(1, 4);
    for (const double offset : offset_m)
      touches[k].contact_time_s.push_back(start_s + offset / touches[k].speed_m_s +
                                          sigma_s * random->Normal());
  }
  return touches;
}

TEST(FlatCalibration, FindsTheOffsetsExactlyWithoutNoiseAtAnySpeeds) {
  RandomStream random(1, RandomDomain::kTest);
  const auto flat =
      CalibrateFlat(Touches(5, {0.0004, -0.0005, 0.0001}, 0, {0.01, 0.02, 0.04}, &random), kSpacingM);
  ASSERT_TRUE(flat.ok()) << flat.status();
  EXPECT_NEAR(flat->offset_m[0], 0.0004, 1e-15);
  EXPECT_NEAR(flat->offset_m[1], -0.0005, 1e-15);
  EXPECT_NEAR(flat->offset_m[2], 0.0001, 1e-15);
  EXPECT_NEAR(flat->sigma_s, 0, 1e-13);
}

TEST(FlatCalibration, ValuesAndStandardErrorsAreThoseOfTheNoise) {
  constexpr int kRounds = 500;
  constexpr double kSigmaS = 0.005;
  const std::vector<double> offset_m = {0.0002, -0.0003, 0.0001};
  double pulls = 0, pull_squares = 0, variances = 0, sigma_pulls = 0;
  for (int round = 0; round < kRounds; ++round) {
    RandomStream random(2, RandomDomain::kTest, round);
    const auto flat = CalibrateFlat(Touches(25, offset_m, kSigmaS, {0.01, 0.02}, &random), kSpacingM);
    ASSERT_TRUE(flat.ok()) << flat.status();
    const double pull = (flat->offset_m[0] - offset_m[0]) / flat->offset_std_error_m[0];
    pulls += pull;
    pull_squares += pull * pull;
    variances += flat->sigma_s * flat->sigma_s;
    sigma_pulls += std::pow((flat->sigma_s - kSigmaS) / flat->sigma_std_error_s, 2);
  }
  EXPECT_NEAR(pulls / kRounds, 0, 4 / std::sqrt(kRounds));
  EXPECT_NEAR(pull_squares / kRounds, 1, 4 * std::sqrt(2.0 / kRounds) + 0.05);
  EXPECT_NEAR(std::sqrt(variances / kRounds), kSigmaS, 0.02 * kSigmaS);
  EXPECT_NEAR(sigma_pulls / kRounds, 1, 0.3);
}

TEST(FlatCalibration, OffsetsInALineMayBeTheTilt) {
  RandomStream random(3, RandomDomain::kTest);
  const double slope = std::tan(0.5 * kRadiansPerDegree);
  const auto tilted = CalibrateFlat(
      Touches(20, {-slope * kSpacingM, 0, slope * kSpacingM}, 1e-4, {0.02}, &random), kSpacingM);
  ASSERT_TRUE(tilted.ok()) << tilted.status();
  EXPECT_NEAR(tilted->tilt_rad / kRadiansPerDegree, 0.5, 4 * tilted->tilt_std_error_rad / kRadiansPerDegree);
  EXPECT_THAT(tilted->note, HasSubstr("tool_tilt"));
  // A middle finger that is longer is no tilt.
  const auto straight = CalibrateFlat(Touches(20, {0.001, -0.002, 0.001}, 1e-4, {0.02}, &random), kSpacingM);
  ASSERT_TRUE(straight.ok()) << straight.status();
  EXPECT_THAT(straight->note, IsEmpty());
}

TEST(FlatCalibration, RefusesWhatTellsNothing) {
  RandomStream random(4, RandomDomain::kTest);
  const auto message = [](const std::vector<FlatTouch>& touches) {
    return std::string(CalibrateFlat(touches, kSpacingM).status().message());
  };
  EXPECT_THAT(message({}), HasSubstr("has 0 touches; at least 3"));
  EXPECT_THAT(message(Touches(2, {0, 0, 0}, 0, {0.02}, &random)), HasSubstr("has 2 touches"));
  const double slope = std::tan(5 * kRadiansPerDegree);
  EXPECT_THAT(message(Touches(9, {-slope * kSpacingM, 0, slope * kSpacingM}, 0, {0.02}, &random)),
              HasSubstr("met at 5.0 degrees"));
  std::vector<FlatTouch> dead = Touches(10, {0, 0, 0}, 1e-3, {0.02}, &random);
  for (int k = 0; k < 4; ++k) dead[k].contact_time_s[1] = kNaN;
  EXPECT_THAT(message(dead), HasSubstr("finger 1 (of 0 to 2) reported in 6 of 10 flat touches"));
  std::vector<FlatTouch> still = Touches(5, {0, 0, 0}, 1e-3, {0.02}, &random);
  still[3].speed_m_s = 0;
  EXPECT_THAT(message(still), HasSubstr("flat touch 3 has speed 0"));
}

TEST(FlatCalibration, LeavesOutWhatNoNoiseExplainsAndSaysSo) {
  RandomStream random(5, RandomDomain::kTest);
  std::vector<FlatTouch> touches = Touches(30, {0.0004, -0.0005, 0.0001}, 1e-3, {0.02}, &random);
  touches[7].contact_time_s[2] += 0.5;
  touches[9].contact_time_s[0] = kNaN;
  const auto flat = CalibrateFlat(touches, kSpacingM);
  ASSERT_TRUE(flat.ok()) << flat.status();
  EXPECT_EQ(flat->touches, 28u);
  EXPECT_EQ(flat->left_out, 2u);
  EXPECT_THAT(flat->note, HasSubstr("2 of 30 touches left out"));
  EXPECT_NEAR(flat->offset_m[2], 0.0001, 4 * flat->offset_std_error_m[2]);
}

TEST(FlatCalibration, TheModelFileHasItsValuesAndKeepsTheOthers) {
  FlatCalibration flat;
  flat.fingers = 3;
  flat.spacing_m = kSpacingM;
  flat.offset_m = {0.0004, -0.0005, 0.0001};
  flat.sigma_s = 0.0049;
  const auto base = model::ParseModel(
      "touchstone: model/1\nname: rig\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
      "  - tip_radius: {radius_mm: 3}\n  - gaussian_noise: {sigma_us: 5000}\n",
      "base.yaml", effects::Catalogue());
  ASSERT_TRUE(base.ok()) << base.status();
  const auto file = CalibratedModelFile(*base, flat, effects::Catalogue());
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT(*file, HasSubstr("finger_length: {offset_mm: [0.4, -0.5, 0.1]}"));
  EXPECT_THAT(*file, HasSubstr("gaussian_noise: {sigma_us: 4900}"));
  EXPECT_THAT(*file, HasSubstr("tip_radius: {radius_mm: 3}"));
  EXPECT_TRUE(model::ParseModel(*file, "new.yaml", effects::Catalogue()).ok());
  EXPECT_FALSE(CalibratedModelFile(model::NominalModel(5), flat, effects::Catalogue()).ok());
}

TEST(FlatCalibration, MeasuredOffsetsMakeAFileToo) {
  RandomStream random(6, RandomDomain::kTest);
  const auto flat = CalibrateFlat(Touches(21, {0.0004, -0.0005, 0.0001}, 0.005, {0.019}, &random), kSpacingM);
  ASSERT_TRUE(flat.ok()) << flat.status();
  const auto file = CalibratedModelFile(model::NominalModel(), *flat, effects::Catalogue());
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_TRUE(model::ParseModel(*file, "new.yaml", effects::Catalogue()).ok());
}

TEST(FlatCalibration, CorrectedTimesAreThoseOfEqualFingers) {
  FlatCalibration flat;
  flat.offset_m = {0.0004, -0.0005, 0.0001};
  const FlatTouch touch{0.02, {1 + 0.0004 / 0.02, 1.5 - 0.0005 / 0.02, kNaN}};
  const std::vector<double> times_s = CorrectedTimes(touch, flat);
  EXPECT_NEAR(times_s[0], 0, 1e-15);
  EXPECT_NEAR(times_s[1], 0.5, 1e-15);
  EXPECT_TRUE(std::isnan(times_s[2]));
}

TEST(FlatCalibration, TimeDistanceAndSpeedCarryTheirErrors) {
  const Uncertain distance = DistanceOf({0.5, 0.001}, {0.02, 0.0002});
  EXPECT_DOUBLE_EQ(distance.value, 0.01);
  EXPECT_DOUBLE_EQ(distance.std_error, std::hypot(0.5 * 0.0002, 0.02 * 0.001));
  const Uncertain time = TimeOf({0.01, 0.00002}, {0.02, 0});
  EXPECT_DOUBLE_EQ(time.value, 0.5);
  EXPECT_DOUBLE_EQ(time.std_error, 0.001);
  const Uncertain speed = SpeedOf({0.01, 0.0001}, {0.5, 0.005});
  EXPECT_DOUBLE_EQ(speed.value, 0.02);
  // Relative errors add in quadrature.
  EXPECT_DOUBLE_EQ(speed.std_error / speed.value, std::hypot(0.01, 0.01));
}

}  // namespace
}  // namespace touchstone::gateway::calibration
