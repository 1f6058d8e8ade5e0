#include "server/diagnosis/boards/board_diagnosis.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/boards/board_search.h"
#include "server/diagnosis/boards/board_test_set.h"
#include "server/diagnosis/engine/uniform_p_values.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::boards {
namespace {

using engine::Verdict;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

BoardDiagnosis Diagnosed(const BoardSet& set, const model::Model& model = model::NominalModel(),
                         uint64_t seed = 0) {
  absl::StatusOr<BoardDiagnosis> diagnosis = DiagnoseBoards(set, model, seed);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *std::move(diagnosis) : BoardDiagnosis();
}

std::vector<std::string> Named(const BoardDiagnosis& diagnosis) {
  std::vector<std::string> names;
  for (const engine::LadderStep& step : diagnosis.steps) names.push_back(step.effect);
  return names;
}

const engine::ParameterEstimate* Find(const BoardDiagnosis& diagnosis, const std::string& parameter,
                                      const std::string& axis = "") {
  for (const engine::LadderStep& step : diagnosis.steps)
    for (const engine::ParameterEstimate& estimate : step.parameters)
      if (estimate.name == parameter && estimate.entry == axis) return &estimate;
  return nullptr;
}

TEST(BoardDiagnosis, ClaimsNothingWhereTheLensIsTheNominalOne) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  int claims = 0;
  for (uint64_t seed = 0; seed < (kUnderSanitizers ? 3 : 30); ++seed) {
    const BoardDiagnosis diagnosis = Diagnosed(MakeBoardSet(LensVector::Zero(), 12, 0.2, 100 + seed));
    claims += diagnosis.verdict != Verdict::kAdequate;
    EXPECT_TRUE(!diagnosis.changed || !diagnosis.steps.empty());
  }
  EXPECT_EQ(claims, 0);
}

double POfNothingMissing(const LensVector& lens, uint64_t seed) {
  const BoardSet set = MakeBoardSet(lens, 8, 0.2, seed);
  const auto search = BoardSearch::Make(set, model::NominalModel());
  EXPECT_TRUE(search.ok()) << search.status();
  const absl::StatusOr<engine::TriedPValues> tried = (*search)->TryAll(seed);
  EXPECT_TRUE(tried.ok()) << tried.status();
  return engine::WorstOfAll(*tried).p;
}

TEST(BoardDiagnosis, HasAUniformPOfNothingMissingUnderTheNominalLens) {
  TOUCHSTONE_SECOND_TIER("statistical: 500 sets");
  std::vector<double> p;
  for (uint64_t set = 0; set < 500; ++set) p.push_back(POfNothingMissing(LensVector::Zero(), 5000 + set));
  engine::ExpectUniform(p);
}

TEST(BoardDiagnosis, HasASmallPOfNothingMissingUnderALensThatIsOff) {
  EXPECT_GT(POfNothingMissing(LensVector::Zero(), 7), 0.01);
  EXPECT_LT(POfNothingMissing(LensWith({{kFocal, 0.02}}), 7), 0.01);
  EXPECT_LT(POfNothingMissing(LensWith({{kK1, -0.02}}), 7), 0.01);
  EXPECT_LT(POfNothingMissing(LensWith({{kP1, 0.003}}), 7), 0.01);  // what has no name counts too
}

TEST(BoardDiagnosis, NamesEachEffectOfTheProjectionAlone) {
  struct Hidden {
    LensVector lens;
    const char* effect;
  };
  for (const Hidden& hidden : {Hidden{LensWith({{kFocal, 0.04}}), "focal_error"},
                               Hidden{LensWith({{kOffsetX, 3}, {kOffsetY, -4}}), "principal_point"},
                               Hidden{LensWith({{kK1, -0.05}, {kK2, 0.02}}), "radial_distortion"}}) {
    const BoardDiagnosis diagnosis = Diagnosed(MakeBoardSet(hidden.lens, 14, 0.2, 7));
    EXPECT_THAT(Named(diagnosis), UnorderedElementsAre(hidden.effect));
    EXPECT_EQ(diagnosis.verdict, Verdict::kMissingEffects) << diagnosis.summary;
    ASSERT_TRUE(diagnosis.final.has_value());
    // Two readings a corner.
    EXPECT_NEAR(diagnosis.final->heldout_rmse, 0.2 * std::sqrt(2.0), 0.03);
  }
}

TEST(BoardDiagnosis, FindsAllThreeWithinTheirErrorsAndTheirModelHasThem) {
  const LensVector lens =
      LensWith({{kFocal, -0.1}, {kOffsetX, 12}, {kOffsetY, -7}, {kK1, -0.28}, {kK2, 0.08}});
  const BoardSet set = MakeBoardSet(lens, 14, 0.2, 8);
  const BoardDiagnosis diagnosis = Diagnosed(set);
  EXPECT_THAT(Named(diagnosis), UnorderedElementsAre("focal_error", "principal_point", "radial_distortion"));
  const std::pair<const engine::ParameterEstimate*, double> found[] = {
      {Find(diagnosis, "relative"), -0.1},
      {Find(diagnosis, "offset_px", "x"), 12},
      {Find(diagnosis, "offset_px", "y"), -7},
      {Find(diagnosis, "k1"), -0.28},
      {Find(diagnosis, "k2"), 0.08}};
  for (const auto& [estimate, truth] : found) {
    ASSERT_NE(estimate, nullptr);
    EXPECT_LT(std::abs(estimate->value - truth), 4 * estimate->std_error) << estimate->name;
    EXPECT_GT(estimate->std_error, 0);
    EXPECT_LT(estimate->lower, estimate->value);
  }
  EXPECT_LT(std::abs(Find(diagnosis, "k1")->value + 0.28), 0.02);
  for (const engine::LadderStep& step : diagnosis.steps) EXPECT_GT(step.probability, 0.99) << step.effect;
  // What a corner is predicted with: as many values as there are readings of them leave almost nothing open.
  ASSERT_EQ(diagnosis.uncertainty.size(), 1u);
  const uncertainty::Budget& budget = diagnosis.uncertainty[0];
  EXPECT_EQ(budget.touches, 14);
  EXPECT_NEAR(budget.repeatability, std::sqrt(2.0) * diagnosis.noise.sigma, 1e-12);
  EXPECT_GT(budget.parameters, 0);
  EXPECT_LT(budget.parameters, 0.1 * budget.repeatability);
  ASSERT_EQ(budget.contributions.size(), 4u);
  EXPECT_EQ(budget.contributions[0].name, "repeatability");
  // Through the improved model nothing is missing any more.
  ASSERT_TRUE(diagnosis.changed);
  EXPECT_EQ(Diagnosed(set, diagnosis.improved).verdict, Verdict::kAdequate);
}

TEST(BoardDiagnosis, StandardErrorsCoverTheTruthAsOftenAsTheySay) {
  TOUCHSTONE_SECOND_TIER("statistical: coverage over many sets");
  if (kUnderSanitizers) GTEST_SKIP() << "statistics over many sets";
  int covered = 0, count = 0;
  for (uint64_t seed = 0; seed < 25; ++seed) {
    const BoardDiagnosis diagnosis =
        Diagnosed(MakeBoardSet(LensWith({{kK1, -0.2}, {kK2, 0.05}}), 20, 0.2, 200 + seed));
    for (const auto& [name, truth] : {std::pair("k1", -0.2), std::pair("k2", 0.05)}) {
      const engine::ParameterEstimate* estimate = Find(diagnosis, name);
      ASSERT_NE(estimate, nullptr);
      covered += estimate->lower <= truth && truth <= estimate->upper;
      ++count;
    }
  }
  EXPECT_GE(covered, 0.84 * count);
}

TEST(BoardDiagnosis, LeavesWhatHasNoEffectNameless) {
  const BoardDiagnosis diagnosis =
      Diagnosed(MakeBoardSet(LensWith({{kK1, -0.2}, {kP1, 0.01}, {kP2, -0.008}}), 14, 0.2, 9));
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnexplained);
  ASSERT_FALSE(diagnosis.rest.empty());
  EXPECT_EQ(diagnosis.rest[0].name, "tangential distortion");
  EXPECT_THAT(diagnosis.summary, HasSubstr("p1 0.0"));
  EXPECT_LT(diagnosis.rest.back().quality.heldout_rmse, diagnosis.final->heldout_rmse);
}

TEST(BoardDiagnosis, SaysThatThereAreTooFewPictures) {
  const BoardDiagnosis diagnosis = Diagnosed(MakeBoardSet(LensWith({{kK1, -0.2}}), 4, 0.2, 10));
  EXPECT_EQ(diagnosis.verdict, Verdict::kTooLittleData);
  EXPECT_TRUE(diagnosis.steps.empty());
  EXPECT_THAT(diagnosis.summary, HasSubstr("found in 4 pictures; 5 are needed"));
}

TEST(BoardDiagnosis, IsTheSameEveryTimeAndErrorsFollowTheSeed) {
  const BoardSet set = MakeBoardSet(LensWith({{kK1, -0.2}}), 10, 0.2, 11);
  const BoardDiagnosis one = Diagnosed(set), again = Diagnosed(set),
                       other = Diagnosed(set, model::NominalModel(), 1);
  EXPECT_EQ(Find(one, "k1")->std_error, Find(again, "k1")->std_error);
  EXPECT_NE(Find(one, "k1")->std_error, Find(other, "k1")->std_error);
  EXPECT_EQ(one.summary, again.summary);
}

TEST(BoardDiagnosis, CountsCopiesOfAPictureOnce) {
  BoardSet set = MakeBoardSet(LensWith({{kFocal, 0.05}, {kK1, -0.2}}), 1, 0.2, 12);
  while (set.pictures.size() < 6) set.pictures.push_back(set.pictures[0]);
  const BoardDiagnosis diagnosis = Diagnosed(set);
  EXPECT_EQ(diagnosis.verdict, Verdict::kTooLittleData);
  EXPECT_TRUE(diagnosis.steps.empty());
  EXPECT_FALSE(diagnosis.lens.has_value());
  EXPECT_EQ(diagnosis.copies.size(), 5u);
  EXPECT_THAT(diagnosis.summary, HasSubstr("found in 1 pictures; 5 are needed"));
}

// Six pictures of one pose, each with its own scatter: no focal length follows from them.
TEST(BoardDiagnosis, RefusesPosesThatDoNotSpan) {
  BoardSet set = MakeBoardSet(LensWith({{kFocal, 0.05}, {kK1, -0.2}}), 1, 0, 12);
  RandomStream random(5, RandomDomain::kTest);
  while (set.pictures.size() < 6) {
    set.pictures.push_back(set.pictures[0]);
    set.pictures.back().file = std::to_string(set.pictures.size()) + ".png";
    for (Eigen::Vector2d& corner : set.pictures.back().corners_px)
      corner += 0.1 * Eigen::Vector2d(random.Normal(), random.Normal());
  }
  const BoardDiagnosis diagnosis = Diagnosed(set);
  EXPECT_EQ(diagnosis.verdict, Verdict::kTooLittleData);
  EXPECT_TRUE(diagnosis.steps.empty());
  EXPECT_EQ(diagnosis.orientations, 1);
  EXPECT_THAT(diagnosis.summary, HasSubstr("1 orientation of 3"));
  EXPECT_THAT(diagnosis.summary, HasSubstr("tilted"));
}

TEST(BoardDiagnosis, GivesTheLensInPixels) {
  const LensVector hidden = LensWith({{kFocal, 0.04}, {kOffsetX, 3}, {kOffsetY, -4}, {kK1, -0.2}});
  const BoardSet set = MakeBoardSet(hidden, 14, 0.2, 7);
  const BoardDiagnosis diagnosis = Diagnosed(set);
  ASSERT_TRUE(diagnosis.lens.has_value());
  const BoardLens& lens = *diagnosis.lens;
  const session::CameraIntrinsics real = CameraWith(set.camera, hidden);
  EXPECT_GT(lens.fx_error_px, 0);
  EXPECT_NEAR(lens.camera.fx_px, real.fx_px, 4 * lens.fx_error_px);
  EXPECT_NEAR(lens.camera.fy_px, real.fy_px, 4 * lens.fy_error_px);
  EXPECT_NEAR(lens.camera.cx_px, real.cx_px, 4 * lens.cx_error_px);
  EXPECT_NEAR(lens.camera.cy_px, real.cy_px, 4 * lens.cy_error_px);
  EXPECT_NEAR(lens.camera.k1, real.k1, 0.02);
  EXPECT_THAT(diagnosis.summary, HasSubstr("The lens: fx "));
  int centres = 0;
  for (const engine::LadderStep& step : diagnosis.steps)
    for (const engine::ParameterEstimate& value : step.parameters) {
      if (step.effect != "principal_point") continue;
      EXPECT_EQ(value.std_error, value.entry == "x" ? lens.cx_error_px : lens.cy_error_px);
      ++centres;
    }
  EXPECT_EQ(centres, 2);
  EXPECT_NE(lens.cx_error_px, lens.cy_error_px);
}

}  // namespace
}  // namespace touchstone::diagnosis::boards
