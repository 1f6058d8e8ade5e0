// The stages together with effects, against closed forms on a plane and a box.
#include "server/touch/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/effects/all_effects.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::touch {
namespace {

// The plane z = 0, two triangles of 2 m, seen from above.
std::shared_ptr<const geometry::Surface> Plane() {
  geometry::TriangleMesh mesh;
  mesh.vertices_m = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return *geometry::Surface::Create("plane", mesh);
}

std::shared_ptr<const model::Model> ModelWith(const std::string& effects, int fingers = 3) {
  std::string yaml = "touchstone: model/1\nname: test\nend_effector: {fingers: " + std::to_string(fingers) +
                     ", spacing_mm: 30}\n";
  if (!effects.empty()) yaml += "effects:\n" + effects;
  auto model = model::ParseModel(yaml, "test", effects::Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  return std::make_shared<const model::Model>(*std::move(model));
}

// One touch from 60 mm above the plane, tilted by `tilt_rad` about y so that finger l (at -x) leads or lags.
struct Simulated {
  effects::TouchBatch batch;
  TouchWorkspace workspace;
};
void Touch(const std::string& effects, double tilt_rad, Simulated* out, int fingers = 3, int count = 1) {
  const TouchSimulator simulator(ModelWith(effects, fingers));
  simulator.Prepare(count, &out->batch);
  out->batch.surface = Plane();
  out->batch.seed = 5;
  for (int k = 0; k < count; ++k) {
    out->batch.index[k] = k;
    out->batch.target_m[k] = {0.01, 0.02, 0};
    out->batch.approach[k] = {std::sin(tilt_rad), 0, -std::cos(tilt_rad)};
    out->batch.lateral[k] = {std::cos(tilt_rad), 0, std::sin(tilt_rad)};
    out->batch.standoff_m[k] = 0.06;
    out->batch.speed_m_s[k] = 0.02;
    out->batch.session_time_s[k] = 1800;
  }
  const absl::Status status = simulator.Run(&out->batch, &out->workspace);
  ASSERT_TRUE(status.ok()) << status;
}

constexpr double kTilt = 0.2;
// On the tilted plane finger i travels standoff + x_i tan(tilt).
double NominalTimeS(double x_m) {
  return (0.06 + x_m * std::tan(kTilt)) / 0.02;
}

TEST(Simulation, OnATiltedPlaneTravelIsTheClosedForm) {
  Simulated s;
  Touch("", kTilt, &s);
  for (int finger = 0; finger < 3; ++finger) {
    EXPECT_NEAR(s.batch.reported_time_s[finger], NominalTimeS(0.03 * (finger - 1)), 1e-9);
    EXPECT_NEAR(s.batch.cos_incidence[finger], std::cos(kTilt), 1e-12);
    EXPECT_NEAR(s.batch.contact_m[finger].z(), 0, 1e-12);
  }
  EXPECT_EQ(s.batch.first_finger[0], 0);
  double descriptor_s[3];
  EXPECT_TRUE(Descriptor(s.batch, 0, descriptor_s));
  EXPECT_EQ(descriptor_s[0], 0);
  EXPECT_NEAR(descriptor_s[2], 0.06 * std::tan(kTilt) / 0.02, 1e-9);
}

TEST(Simulation, AnyNumberOfFingersStandsSymmetrically) {
  for (int fingers : {1, 2, 7, 16}) {
    Simulated s;
    Touch("", kTilt, &s, fingers);
    for (int finger = 0; finger < fingers; ++finger)
      EXPECT_NEAR(s.batch.reported_time_s[finger], NominalTimeS(0.03 * (finger - 0.5 * (fingers - 1))), 1e-9);
  }
}

TEST(Simulation, ABallTipTouchesAnObliquePlaneEarlierByRadiusOverCosineLessRadius) {
  Simulated s;
  Touch("  - tip_radius: {radius_mm: 3}\n", kTilt, &s);
  for (int finger = 0; finger < 3; ++finger)
    EXPECT_NEAR(s.batch.reported_time_s[finger],
                NominalTimeS(0.03 * (finger - 1)) - 0.003 * (1 / std::cos(kTilt) - 1) / 0.02, 1e-7);
}

TEST(Simulation, TheRampCostsHalfTheSpeedOverTheAcceleration) {
  Simulated s;
  Touch("  - acceleration_ramp: {acceleration_mm_s2: 100}\n", kTilt, &s);
  EXPECT_NEAR(s.batch.reported_time_s[1], NominalTimeS(0) + 0.02 / (2 * 0.1), 1e-9);
}

TEST(Simulation, SlowdownStretchesOnlyWhatComesAfterTheFirstContact) {
  Simulated s;
  Touch("  - contact_slowdown: {fraction: 0.2}\n", kTilt, &s);
  const double first_s = NominalTimeS(-0.03);
  EXPECT_NEAR(s.batch.reported_time_s[0], first_s, 1e-9);
  EXPECT_NEAR(s.batch.reported_time_s[2], first_s + (NominalTimeS(0.03) - first_s) / 0.8, 1e-9);
}

TEST(Simulation, PushDelaysEveryFingerButTheFirst) {
  Simulated s;
  Touch("  - object_push: {shift_mm: 0.3}\n", kTilt, &s);
  EXPECT_NEAR(s.batch.reported_time_s[0], NominalTimeS(-0.03), 1e-9);
  EXPECT_NEAR(s.batch.reported_time_s[1], NominalTimeS(0) + 0.015, 1e-9);
  EXPECT_NEAR(s.batch.reported_time_s[2], NominalTimeS(0.03) + 0.015, 1e-9);
}

TEST(Simulation, ScaledAndMovedObjectsAreMetWhereTheyAre) {
  Simulated s;
  Touch("  - object_pose: {translation_mm: [0, 0, 2], rotation_deg: [0, 0, 30]}\n", kTilt, &s);
  EXPECT_NEAR(s.batch.reported_time_s[1], NominalTimeS(0) - 0.002 / std::cos(kTilt) / 0.02, 1e-8);
  EXPECT_NEAR(s.batch.contact_m[1].z(), 0.002, 1e-9);
  EXPECT_NEAR(s.batch.normal[1].z(), 1, 1e-9);
}

TEST(Simulation, SensorEffectsActThroughTheSpeedAtContact) {
  Simulated s;
  Touch("  - oblique_slip: {travel_mm: 0.5}\n  - clock_skew: {relative: 0.01}\n", kTilt, &s);
  EXPECT_NEAR(s.batch.reported_time_s[1], (NominalTimeS(0) + 0.0005 * std::tan(kTilt) / 0.02) * 1.01, 1e-8);
}

TEST(Simulation, NoiseHasItsSigmaOnEveryFingerAndNothingInCommon) {
  Simulated s;
  const int n = 20000;
  Touch("  - gaussian_noise: {sigma_us: 5000}\n", kTilt, &s, 3, n);
  double covariance[3][3] = {};
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        covariance[i][j] += (s.batch.reported_time_s[s.batch.At(i, k)] - NominalTimeS(0.03 * (i - 1))) *
                            (s.batch.reported_time_s[s.batch.At(j, k)] - NominalTimeS(0.03 * (j - 1))) / n;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(covariance[i][j] / 25e-6, i == j ? 1 : 0, 5 * std::sqrt(2.0 / n));
}

TEST(Simulation, StudentNoiseHasTheQuartilesOfStudentsT) {
  Simulated s;
  const int n = 20000;
  Touch("  - gaussian_noise: {sigma_us: 5000}\n  - heavy_tail_noise: {degrees_of_freedom: 3}\n", kTilt, &s, 3,
        n);
  int within = 0;
  for (int k = 0; k < n; ++k)
    within += std::abs(s.batch.reported_time_s[s.batch.At(1, k)] - NominalTimeS(0)) <
              0.005 * 0.76489;  // t_3 quartile
  EXPECT_NEAR(within / double(n), 0.5, 5 * 0.5 / std::sqrt(n));
}

TEST(Simulation, PolledTimesLieOnTicksOfOnePhaseATouch) {
  Simulated s;
  Touch("  - poll_interval: {interval_us: 2000}\n", kTilt, &s, 3, 50);
  for (int k = 0; k < 50; ++k) {
    for (int finger = 0; finger < 3; ++finger) {
      const double late_s =
          s.batch.reported_time_s[s.batch.At(finger, k)] - s.batch.contact_time_s[s.batch.At(finger, k)];
      EXPECT_GE(late_s, -1e-12);
      EXPECT_LT(late_s, 0.002);
    }
    const double ticks =
        (s.batch.reported_time_s[s.batch.At(2, k)] - s.batch.reported_time_s[s.batch.At(0, k)]) / 0.002;
    EXPECT_NEAR(ticks, std::round(ticks), 1e-9);
  }
}

TEST(Simulation, MissedContactsAreNotANumberAtTheirProbability) {
  Simulated s;
  const int n = 20000;
  Touch("  - missed_contact: {probability: 0.1}\n", kTilt, &s, 3, n);
  int missed = 0;
  for (double time_s : s.batch.reported_time_s) missed += std::isnan(time_s);
  EXPECT_NEAR(missed / (3.0 * n), 0.1, 5 * std::sqrt(0.09 / (3 * n)));
}

TEST(Simulation, ASampleDoesNotHangOnItsCompany) {
  const std::string effects = "  - gaussian_noise: {sigma_us: 5000}\n  - poll_interval: {interval_us: 10}\n";
  Simulated many, one;
  Touch(effects, kTilt, &many, 3, 100);
  Touch(effects, kTilt, &one, 3, 1);
  for (int finger = 0; finger < 3; ++finger)
    EXPECT_EQ(many.batch.reported_time_s[many.batch.At(finger, 0)], one.batch.reported_time_s[finger]);
}

TEST(Simulation, AFingerBesideTheObjectReportsNothingAndTheOthersDo) {
  const TouchSimulator simulator(ModelWith(""));
  effects::TouchBatch batch;
  TouchWorkspace workspace;
  simulator.Prepare(1, &batch);
  batch.surface = Plane();
  batch.target_m[0] = {0.98, 0, 0};
  batch.approach[0] = {0, 0, -1};
  batch.lateral[0] = {1, 0, 0};
  batch.standoff_m[0] = 0.06;
  batch.speed_m_s[0] = 0.02;
  ASSERT_TRUE(simulator.Run(&batch, &workspace).ok());
  double descriptor_s[3];
  EXPECT_FALSE(Descriptor(batch, 0, descriptor_s));
  EXPECT_NEAR(descriptor_s[1], 0, 1e-9);
  EXPECT_TRUE(std::isnan(descriptor_s[2]));
}

TEST(Simulation, AFormulaWithoutItsCovariateIsAnErrorThatNamesIt) {
  const TouchSimulator simulator(
      ModelWith("  - formula: {name: warm, adds: travel_mm, expression: \"k * cov_temperature\", parameters: "
                "{k: {value: "
                "1, unit: mm, min: -1, max: 1}}}\n"));
  effects::TouchBatch batch;
  TouchWorkspace workspace;
  simulator.Prepare(1, &batch);
  batch.surface = Plane();
  EXPECT_THAT(std::string(simulator.Run(&batch, &workspace).message()),
              testing::HasSubstr("cov_temperature"));
}

}  // namespace
}  // namespace touchstone::touch
