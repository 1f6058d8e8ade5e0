#include "server/diagnosis/selection/curves/time_course.h"

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

#include "server/diagnosis/selection/selection.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

// The courses over what the initial model leaves of a rig with this lookup over session time.
std::vector<NamelessCurve> CoursesOfRig(const std::vector<std::string>& lookup, uint64_t seed = 1) {
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  if (!lookup.empty()) rig.hidden = {{"lookup", lookup}};
  rig.seed = seed;
  const auto workspace = MakeWorkspace(touches::MakeTestInput(rig), {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  EXPECT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const Workspace& w = **workspace;
  const auto fit =
      engine::FitModel(w.experiment, engine::Parameterization(*w.input.model, w.searched->objects));
  EXPECT_TRUE(fit.ok());
  const auto details = w.searched_predictor->Run(fit->model.base(), true, true);
  const std::vector<CurveCovariate> covariates = ListCurveCovariates(*w.searched, *details);
  EXPECT_EQ(covariates[0].name, "session_time_s");
  return ScoreTimeCourses(w.experiment, *w.rows, *fit, *details, covariates[0]).curves;
}

const NamelessCurve& Best(const std::vector<NamelessCurve>& curves) {
  return *std::max_element(curves.begin(), curves.end(), [](const NamelessCurve& a, const NamelessCurve& b) {
    return a.gain_nats < b.gain_nats;
  });
}

TEST(TimeCourse, AStepIsFoundWithItsTouchAndItsFinger) {
  const auto curves = CoursesOfRig({"name=step", "adds=travel_mm", "covariate=session_time_s",
                                    "knots=1499,1500", "l=0,0.2", "m=0,0", "r=0,0"});
  ASSERT_FALSE(curves.empty());
  const NamelessCurve& step = Best(curves);
  EXPECT_TRUE(IsSignificant(step));
  ASSERT_EQ(step.knots.size(), 2u);
  EXPECT_NEAR(step.knots[1], 1500, 60);
  EXPECT_NEAR(step.values[0][1] - step.values[1][1], 0.2, 0.03);
  EXPECT_EQ(step.values[0][0], 0);
  EXPECT_NE(step.words.find("on finger l travels 0.2"), std::string::npos) << step.words;
}

TEST(TimeCourse, AStretchEndsAgain) {
  const auto curves = CoursesOfRig({"name=stretch", "adds=travel_mm", "covariate=session_time_s",
                                    "knots=1199,1200,1799,1800", "l=0,0,0,0", "m=0,0.3,0.3,0", "r=0,0,0,0"});
  ASSERT_FALSE(curves.empty());
  const NamelessCurve& stretch = Best(curves);
  ASSERT_EQ(stretch.knots.size(), 4u);
  EXPECT_NEAR(stretch.knots[1], 1200, 60);
  EXPECT_NEAR(stretch.knots[2], 1800, 60);
  EXPECT_NE(stretch.words.find("finger m"), std::string::npos) << stretch.words;
}

TEST(TimeCourse, AWarmUpLevelsOff) {
  const auto curves =
      CoursesOfRig({"name=warm_up", "adds=travel_mm", "covariate=session_time_s",
                    "knots=0,100,200,300,400,600,900,1200", "l=0,0,0,0,0,0,0,0", "m=0,0,0,0,0,0,0,0",
                    "r=0,-0.0885,-0.1580,-0.2110,-0.2544,-0.3106,-0.3525,-0.3754"});
  ASSERT_FALSE(curves.empty());
  const NamelessCurve& warm_up = Best(curves);
  EXPECT_GT(warm_up.knots.size(), 8u);
  EXPECT_NEAR(warm_up.values[2].back() - warm_up.values[0].back(), -0.4, 0.06);
  EXPECT_NE(warm_up.words.find("time constant"), std::string::npos) << warm_up.words;
}

TEST(TimeCourse, AWaveHasItsPeriod) {
  std::string knots = "knots=0", values = "m=0", none = "=0";
  for (int k = 1; k <= 160; ++k) {
    absl::StrAppend(&knots, ",", 20 * k);
    absl::StrAppend(&values, ",", 0.15 * std::sin(2 * kPi * 20 * k / 470));
    none += ",0";
  }
  const auto curves = CoursesOfRig(
      {"name=wave", "adds=travel_mm", "covariate=session_time_s", knots, "l" + none, values, "r" + none});
  ASSERT_FALSE(curves.empty());
  const NamelessCurve& wave = Best(curves);
  EXPECT_GT(wave.knots.size(), 20u);
  EXPECT_NE(wave.words.find("waves with a period of 47"), std::string::npos) << wave.words;
}

TEST(TimeCourse, NothingHiddenHasNone) {
  for (uint64_t seed = 1; seed <= 3; ++seed)
    for (const NamelessCurve& curve : CoursesOfRig({}, seed)) EXPECT_LT(curve.gain_nats, 3) << curve.words;
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
