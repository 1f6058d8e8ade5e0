#include "server/diagnosis/selection/curves/nameless_curve.h"

#include <gtest/gtest.h>

#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

std::vector<NamelessCurve> CurvesOf(const TestSearch& search) {
  return ScoreCurves(search.workspace->experiment, *search.workspace->rows, search.fit, search.details, "");
}

TEST(NamelessCurve, FollowsAWaveInTheIncidence) {
  const std::vector<NamelessCurve> curves =
      CurvesOf(PrepareTestSearch({{"lookup",
                                   {"name=wave", "adds=travel_mm", "covariate=incidence_deg",
                                    "knots=0,8,16,24,32,40,60", "values=0,0.3,0,0.3,0,0.3,0"}}}));
  ASSERT_FALSE(curves.empty());
  EXPECT_EQ(curves[0].covariate, "incidence_deg");
  EXPECT_FALSE(curves[0].per_finger);
  EXPECT_TRUE(IsSignificant(curves[0]));
  EXPECT_LT(curves[0].p, 1e-6);
}

TEST(NamelessCurve, FollowsATimeThatNoLineDescribes) {
  const std::vector<NamelessCurve> curves = CurvesOf(PrepareTestSearch(
      {{"lookup",
        {"name=warm", "adds=travel_mm", "covariate=session_time_s", "knots=0,600,1200,1800,2400,3000",
         "l=0,0.3,0,0.3,0,0.3", "m=0,0,0,0,0,0", "r=0,0,0,0,0,0"}}}));
  ASSERT_FALSE(curves.empty());
  EXPECT_EQ(curves[0].covariate, "session_time_s");
  EXPECT_TRUE(curves[0].per_finger);
  EXPECT_TRUE(IsSignificant(curves[0]));
}

TEST(NamelessCurve, IsNotFoundWhereNothingIsHidden) {
  for (uint64_t seed = 1; seed <= 3; ++seed)
    for (const NamelessCurve& curve : CurvesOf(PrepareTestSearch({}, seed)))
      EXPECT_FALSE(IsSignificant(curve)) << curve.covariate;
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
