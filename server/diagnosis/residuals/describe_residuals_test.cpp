#include "server/diagnosis/residuals/describe_residuals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/made_up_test_set.h"

namespace touchstone {
namespace {

constexpr double kSigmaS = 0.005;

v1::Report Describe(const MadeUpSet& set, double sigma_s = kSigmaS, uint64_t seed = 0) {
  v1::Report report;
  DescribeResiduals(set.observations, set.prediction, set.prediction, set.residuals, set.residuals,
                    {sigma_s, 0.03, seed}, &report);
  return report;
}

double CurveP(const v1::Report& report, const std::string& name) {
  for (const v1::CovariateCurve& curve : report.curves())
    if (curve.covariate() == name) return curve.p();
  ADD_FAILURE() << "no curve " << name;
  return NAN;
}

// Contacts come early by 1 ms a degree, on every finger.
MadeUpSet EarlyOnSlopes() {
  MadeUpSet set(5, 48, 4, kSigmaS, 1);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i) set.observations.time_s[k * 3 + i] -= 1e-3 * set.IncidenceDeg(k, i);
  set.Finish();
  return set;
}

TEST(ResidualGroups, EveryKindAddsUpToAllTouchesAndToTheWholeExcess) {
  const v1::Report report = Describe(EarlyOnSlopes());
  std::map<std::string, std::pair<double, double>> sums;
  for (const v1::GroupError& group : report.groups()) {
    sums[group.kind()].first += group.touches();
    sums[group.kind()].second += group.share_of_excess_error();
  }
  for (const char* kind : {"object", "face", "finger", "round", "time", "speed"}) {
    EXPECT_EQ(sums[kind].first, std::string(kind) == "finger" ? 3 * 960 : 960) << kind;
    EXPECT_NEAR(sums[kind].second, 1, 1e-9) << kind;
  }
}

TEST(ResidualGroups, OfNoiseHaveTheRmseSigma) {
  const v1::Report made = Describe(MadeUpSet(5, 48, 4, kSigmaS, 2));
  for (const v1::GroupError& group : made.groups())
    EXPECT_NEAR(group.rmse_us(), 5000, group.touches() > 500 ? 400 : 1100)
        << group.kind() << " " << group.name();
}

TEST(ResidualGroups, TheBiasOfALateFingerIsTwoThirdsOfItAndTheWorstTouchIsFirst) {
  MadeUpSet set(2, 48, 4, kSigmaS, 3);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 2] += 0.03;
  set.observations.time_s[77 * 3] -= 1;
  set.observations.time_s[99 * 3] -= 2;
  set.observations.used[99] = 0;
  set.Finish();
  const v1::Report report = Describe(set);
  EXPECT_THAT(report.finger_bias_us(),
              testing::ElementsAre(testing::Lt(-9000), testing::Lt(-8000), testing::Gt(19000)));
  ASSERT_EQ(report.worst_touches_size(), 10);
  EXPECT_EQ(report.worst_touches(0).touch(), 77u);
  EXPECT_GT(report.worst_touches(0).norm_us(), report.worst_touches(1).norm_us());
}

TEST(ResidualCurves, AreFlatUnderNoiseAndTheirPIsHonest) {
  int claims = 0, curves = 0;
  for (int seed = 0; seed < 20; ++seed) {
    const v1::Report made = Describe(MadeUpSet(3, 48, 4, kSigmaS, 100 + seed));
    for (const v1::CovariateCurve& curve : made.curves()) {
      ++curves;
      claims += curve.p() < 0.05;
    }
  }
  EXPECT_GT(curves, 200);
  EXPECT_LE(claims, 5);  // 20 families at 0.05: one is expected
}

TEST(ResidualCurves, FollowTheEffectAndNameItsCovariateOnly) {
  const v1::Report report = Describe(EarlyOnSlopes());
  EXPECT_LT(CurveP(report, "incidence_deg"), 1e-9);
  EXPECT_GT(CurveP(report, "session_time_s"), 0.01);
  EXPECT_GT(CurveP(report, "lateral_z"), 0.01);
  for (const v1::CovariateCurve& curve : report.curves()) {
    if (curve.covariate() != "incidence_deg") continue;
    EXPECT_EQ(curve.unit(), "deg");
    EXPECT_EQ(curve.bins_size(), 36);
    // Two thirds of the slope are left after the touch's mean is taken off.
    for (const v1::CurveBin& bin : curve.bins())
      EXPECT_NEAR(bin.mean_residual_us(), -1000 * 2.0 / 3 * (bin.centre() - 15), 5 * bin.std_error_us() + 1);
  }
}

TEST(ResidualCurves, RepeatsOfAPoseAreNotTakenForEvidence) {
  // Every pose has an error of its own that no covariate explains.
  int claims = 0;
  for (int seed = 0; seed < 20; ++seed) {
    MadeUpSet set(2, 48, 8, kSigmaS, 200 + seed);
    for (int k = 0; k < set.size(); ++k)
      for (int i = 0; i < 3; ++i)
        set.observations.time_s[k * 3 + i] +=
            4 * kSigmaS * RandomStream(seed, RandomDomain::kTest, set.observations.pose[k] * 3 + i).Normal();
    set.Finish();
    const v1::Report made = Describe(set);
    for (const v1::CovariateCurve& curve : made.curves()) claims += curve.p() < 0.05;
  }
  EXPECT_LE(claims, 5);
}

TEST(ResidualCurves, ADriftIsSeenThroughTheRepeats) {
  MadeUpSet set(2, 48, 8, kSigmaS, 4);
  for (int k = 0; k < set.size(); ++k)
    set.observations.time_s[k * 3] += 0.01 * set.observations.set->session_time_s[k] / 7680;
  set.Finish();
  EXPECT_LT(CurveP(Describe(set), "session_time_s"), 1e-4);
}

TEST(ResidualHistograms, OfARightModelAgreeAndOfASilentOneDoNot) {
  const MadeUpSet set(5, 48, 4, kSigmaS, 5);
  const v1::Report right = Describe(set);
  EXPECT_EQ(right.histograms_size(), 12);  // two quantities, five objects and all
  int small = 0;
  for (const v1::Histogram& histogram : right.histograms()) {
    EXPECT_LE(histogram.measured_size(), 60);
    EXPECT_EQ(histogram.edges_size(), histogram.measured_size() + 1);
    small += histogram.p_simulated() < 0.02;
    double integral = 0;
    for (const double density : histogram.measured()) integral += density;
    EXPECT_NEAR(integral * (histogram.edges(1) - histogram.edges(0)), 1, 0.01);
  }
  EXPECT_LE(small, 2);
}

TEST(ResidualHistograms, TellAShiftOfOneSigmaApart) {
  MadeUpSet set(5, 48, 4, kSigmaS, 6);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 1] -= 20 * kSigmaS;
  set.Finish();
  v1::Report report;
  MadeUpSet true_set = set;
  for (int k = 0; k < set.size(); ++k) true_set.prediction.time_s[k * 3 + 1] -= 20 * kSigmaS;
  true_set.Finish();
  DescribeResiduals(set.observations, set.prediction, true_set.prediction, set.residuals, true_set.residuals,
                    {kSigmaS, 0.03, 0}, &report);
  for (const v1::Histogram& histogram : report.histograms()) {
    if (histogram.quantity() != "curvature_per_m" || !histogram.object().empty()) continue;
    EXPECT_LT(histogram.p_simulated(), 1e-3);
    EXPECT_GT(histogram.p_improved(), 0.01);
  }
}

TEST(ResidualHistograms, AreCalibrated) {
  int small = 0;
  for (int seed = 0; seed < 60; ++seed) {
    const v1::Report made = Describe(MadeUpSet(1, 48, 4, kSigmaS, 300 + seed), kSigmaS, seed);
    for (const v1::Histogram& histogram : made.histograms()) small += histogram.p_simulated() < 0.1;
  }
  EXPECT_GE(small, 2);  // 120 tests at 0.1: 12 are expected
  EXPECT_LE(small, 24);
}

TEST(ResidualPlots, AreThinnedAndParityDiffersByTheResidual) {
  const MadeUpSet set = EarlyOnSlopes();
  const v1::Report report = Describe(set);
  EXPECT_EQ(report.parity_size(), 2000);
  double squares = 0;
  for (const v1::ParityPoint& point : report.parity())
    squares += std::pow(point.measured_us() - point.simulated_us(), 2);
  double all = 0;
  for (const double r : set.residuals) all += r * r;
  EXPECT_NEAR(std::sqrt(squares / 2000), std::sqrt(all / set.residuals.size()) * 1e6, 300);
  EXPECT_EQ(report.surface_points_size(), 5 * 48 * 3);  // repeats share a spot
}

TEST(ResidualPlots, OutlinesAreCoarseCopiesInMillimetres) {
  MadeUpSet set(1, 4, 2, kSigmaS, 7);
  TriangleMesh sphere;  // an octahedron divided five times: 8192 triangles, radius 50 mm
  sphere.vertices_m = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  sphere.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < 5; ++level) {
    std::vector<std::array<uint32_t, 3>> finer;
    for (const auto& t : sphere.triangles) {
      std::array<uint32_t, 3> middle;
      for (int c = 0; c < 3; ++c) {
        middle[c] = static_cast<uint32_t>(sphere.vertices_m.size());
        sphere.vertices_m.push_back(
            (sphere.vertices_m[t[c]] + sphere.vertices_m[t[(c + 1) % 3]]).normalized());
      }
      finer.push_back({t[0], middle[0], middle[2]});
      finer.push_back({t[1], middle[1], middle[0]});
      finer.push_back({t[2], middle[2], middle[1]});
      finer.push_back({middle[0], middle[1], middle[2]});
    }
    sphere.triangles = finer;
  }
  for (Eigen::Vector3f& vertex : sphere.vertices_m) vertex *= 0.05f;
  set.observations.surfaces[0] = *Surface::Create("ball", sphere);
  const v1::Report report = Describe(set);
  ASSERT_EQ(report.outlines_size(), 1);
  const v1::ObjectOutline& outline = report.outlines(0);
  EXPECT_LE(outline.triangles_size(), 3 * 400);
  EXPECT_GE(outline.triangles_size(), 3 * 150);
  for (int v = 0; v < outline.vertices_mm_size(); v += 3) {
    const double radius =
        std::hypot(outline.vertices_mm(v), outline.vertices_mm(v + 1), outline.vertices_mm(v + 2));
    EXPECT_NEAR(radius, 48, 3);
  }
  for (const uint32_t corner : outline.triangles())
    EXPECT_LT(corner, static_cast<uint32_t>(outline.vertices_mm_size() / 3));
}

TEST(DescribeResiduals, SaysTheSameTwice) {
  const MadeUpSet set = EarlyOnSlopes();
  EXPECT_EQ(Describe(set).SerializeAsString(), Describe(set).SerializeAsString());
}

TEST(DescribeResiduals, OfManyTouchesPicturesShowAPart) {
  const MadeUpSet set(5, 1000, 12, kSigmaS, 8);
  const v1::Report report = Describe(set);
  EXPECT_EQ(report.parity_size(), 2000);
  EXPECT_LE(report.surface_points_size(), 4000);
}

TEST(DescribeResiduals, AnEmptySetOrOneFingerGivesAnEmptyReport) {
  MadeUpSet set(1, 2, 1, kSigmaS, 9);
  for (double& time_s : set.observations.time_s) time_s = NAN;
  set.Finish();
  const v1::Report report = Describe(set);
  EXPECT_EQ(report.groups_size(), 0);
  EXPECT_EQ(report.parity_size(), 0);
  EXPECT_EQ(report.histograms_size(), 0);
}

}  // namespace
}  // namespace touchstone
