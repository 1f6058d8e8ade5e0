#include "server/diagnosis/residuals/slices/curves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

std::vector<ResidualCurve> Curves(const touches::SyntheticSet& set) {
  return MakeResidualCurves(set.observations, set.prediction, set.residuals, set.residuals, 0);
}

double CurveP(const std::vector<ResidualCurve>& curves, const std::string& name) {
  for (const ResidualCurve& curve : curves)
    if (curve.covariate == name) return curve.p_value;
  ADD_FAILURE() << "no curve " << name;
  return NAN;
}

TEST(ResidualCurves, AreFlatUnderNoiseAndTheirPIsHonest) {
  int claims = 0, curves = 0;
  for (int seed = 0; seed < 20; ++seed) {
    const auto made = Curves(touches::SyntheticSet(3, 48, 4, touches::kSyntheticSigmaS, 100 + seed));
    for (const ResidualCurve& curve : made) {
      ++curves;
      claims += curve.p_value < 0.05;
    }
  }
  EXPECT_GT(curves, 200);
  EXPECT_LE(claims, 5);  // 20 families at 0.05: one is expected
}

TEST(ResidualCurves, FollowTheEffectAndNameItsCovariateOnly) {
  const auto curves = Curves(touches::EarlyOnSlopes());
  EXPECT_LT(CurveP(curves, "incidence_deg"), 1e-9);
  EXPECT_GT(CurveP(curves, "session_time_s"), 0.01);
  EXPECT_GT(CurveP(curves, "lateral_z"), 0.01);
  for (const ResidualCurve& curve : curves) {
    if (curve.covariate != "incidence_deg") continue;
    EXPECT_EQ(curve.unit, "deg");
    EXPECT_EQ(curve.bins.size(), 36u);
    // Two thirds of the slope are left after the touch's mean is taken off.
    for (const ResidualCurveBin& bin : curve.bins)
      EXPECT_NEAR(bin.mean_residual_s, -0.001 * 2.0 / 3 * (bin.centre - 15), 5 * bin.std_error_s + 1e-6);
  }
}

TEST(ResidualCurves, RepeatsOfAPoseAreNotTakenForEvidence) {
  // Every pose has an error of its own that no covariate explains.
  int claims = 0;
  for (int seed = 0; seed < 20; ++seed) {
    touches::SyntheticSet set(2, 48, 8, touches::kSyntheticSigmaS, 200 + seed);
    for (int k = 0; k < set.size(); ++k)
      for (int i = 0; i < 3; ++i)
        set.observations.time_s[k * 3 + i] +=
            4 * touches::kSyntheticSigmaS *
            RandomStream(seed, RandomDomain::kTest, set.observations.pose[k] * 3 + i).Normal();
    set.Finish();
    const auto made = Curves(set);
    for (const ResidualCurve& curve : made) claims += curve.p_value < 0.05;
  }
  EXPECT_LE(claims, 5);
}

TEST(ResidualCurves, ADriftIsSeenThroughTheRepeats) {
  touches::SyntheticSet set(2, 48, 8, touches::kSyntheticSigmaS, 4);
  for (int k = 0; k < set.size(); ++k)
    set.observations.time_s[k * 3] += 0.01 * set.observations.set->session_time_s[k] / 7680;
  set.Finish();
  EXPECT_LT(CurveP(Curves(set), "session_time_s"), 1e-4);
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
