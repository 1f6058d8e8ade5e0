#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/images/photo_test_set.h"
#include "server/diagnosis/images/terms/photo_term_scores.h"

namespace touchstone::diagnosis::images {
namespace {

using testing::HasSubstr;

HiddenCamera SmallRig() {
  HiddenCamera rig;
  rig.photographs = kUnderSanitizers ? 4 : 6;
  rig.side_px = 96;
  return rig;
}

PhotographDiagnosis DiagnosisOf(const DiagnosisInput& input) {
  auto diagnosis = DiagnosePhotographs(input, {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return *std::move(diagnosis);
}

// What a comparison finds with the improved model, or the given one, and this effect behind it.
double ErrorWith(const DiagnosisInput& input, const PhotographDiagnosis& diagnosis,
                 const std::string& effect) {
  const std::string improved = model::FormatModel(diagnosis.changed ? diagnosis.improved : *input.model);
  const auto with = model::ParseModel(absl::StrCat(improved, effect), "with", effects::Catalogue());
  EXPECT_TRUE(with.ok()) << with.status();
  if (!with.ok()) return NAN;
  DiagnosisInput again = input;
  again.model = std::make_shared<const model::Model>(*with);
  const auto compared = ComparePhotographs(again, {});
  EXPECT_TRUE(compared.ok()) << compared.status();
  return compared->initial->rmse;
}

TEST(SuggestForRest, FindsBandsAcrossThePicture) {
  HiddenCamera rig = SmallRig();
  rig.unlisted = [&](int, int, int row, const image::Photo& photo, size_t pixel) {
    return 0.08 * photo.grey[pixel] * std::sin(2 * M_PI * (row + 0.5) / (rig.side_px / 5.0));
  };
  const DiagnosisInput input = MakePhotoInput(rig);
  const PhotographDiagnosis diagnosis = DiagnosisOf(input);
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(diagnosis.unexplained.has_value());
  const engine::UnexplainedRest& rest = *diagnosis.unexplained;
  EXPECT_THAT(rest.formula, HasSubstr("sin(2*pi*row/period)"));
  EXPECT_THAT(rest.formula, HasSubstr("grey"));
  EXPECT_THAT(rest.formula_yaml, HasSubstr("adds: grey"));
  EXPECT_THAT(rest.lookup_yaml, testing::IsEmpty());
  EXPECT_GT(rest.heldout_gain, 0.8);
  EXPECT_LT(rest.rmse, 0.8 * diagnosis.final->rmse);
  EXPECT_GE(rest.heldout_rmse, rest.rmse);
  EXPECT_NEAR(ErrorWith(input, diagnosis, rest.formula_yaml), rest.rmse, 1e-3 * rest.rmse);
}

TEST(SuggestForRest, GivesACurveForARing) {
  TOUCHSTONE_SECOND_TIER("long: every curve and formula over all pixels");
  HiddenCamera rig = SmallRig();
  rig.unlisted = [&](int, int column, int row, const image::Photo&, size_t) {
    const double radius = std::hypot(column + 0.5 - 0.5 * rig.side_px, row + 0.5 - 0.5 * rig.side_px) /
                          (0.5 * std::hypot(rig.side_px, rig.side_px));
    return 14 * std::exp(-std::pow((radius - 0.3) / 0.1, 2));
  };
  const DiagnosisInput input = MakePhotoInput(rig);
  const PhotographDiagnosis diagnosis = DiagnosisOf(input);
  ASSERT_TRUE(diagnosis.unexplained.has_value());
  const engine::UnexplainedRest& rest = *diagnosis.unexplained;
  EXPECT_THAT(rest.lookup_yaml, HasSubstr("covariate: radius"));
  EXPECT_THAT(rest.formula_yaml, testing::IsEmpty());
  EXPECT_GT(rest.heldout_gain, 0.5);
  EXPECT_NEAR(ErrorWith(input, diagnosis, rest.lookup_yaml), rest.rmse, 1e-3 * rest.rmse);
}

TEST(SuggestForRest, NamesNoFormulaForDirtOnTheLens) {
  TOUCHSTONE_SECOND_TIER("long: every curve and formula over all pixels");
  HiddenCamera rig = SmallRig();
  rig.unlisted = [&](int, int column, int row, const image::Photo& photo, size_t pixel) {
    double shade = 0;
    for (const auto& [x, y] : {std::pair(0.62, 0.36), std::pair(0.40, 0.55), std::pair(0.55, 0.62)})
      shade += std::exp(
          -0.5 * (std::pow(column / (x * rig.side_px) - 1, 2) + std::pow(row / (y * rig.side_px) - 1, 2)) /
          std::pow(0.08, 2));
    return -0.25 * photo.grey[pixel] * shade;
  };
  const PhotographDiagnosis diagnosis = DiagnosisOf(MakePhotoInput(rig));
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(diagnosis.unexplained.has_value());
  EXPECT_THAT(diagnosis.unexplained->formula_yaml, testing::IsEmpty());
  EXPECT_THAT(diagnosis.unexplained->lookup_yaml, testing::IsEmpty());
  EXPECT_EQ(diagnosis.unexplained->heldout_gain, 0);
}

// One column of ones over poses whose means are `mean`, 100 pixels of unit noise each.
TermScore ScoreOfMeans(const std::vector<double>& mean, const std::vector<int>& objects) {
  std::vector<PoseSums> poses;
  for (const double m : mean)
    poses.push_back({Eigen::MatrixXd::Constant(1, 1, 100), Eigen::VectorXd::Constant(1, 100 * m)});
  return ScoreSums(poses, objects, Eigen::MatrixXd::Constant(1, 1, 0.01));
}

TEST(ScoreSums, CountScatterBetweenPosesAsNoise) {
  const std::vector<int> objects = {0, 0, 0, 0, 1, 1, 1, 1};
  const TermScore steady = ScoreOfMeans({1, 1.1, 0.9, 1, 1, 1.1, 0.9, 1}, objects);
  EXPECT_GT(steady.gain_nats, 100);
  EXPECT_LT(steady.p, 1e-20);
  EXPECT_TRUE(steady.every_object);
  EXPECT_NEAR(steady.values[0], 1, 0.01);
  EXPECT_NEAR(steady.taken_unseen, steady.taken, 0.05 * steady.taken);
  // As large a mean of means that differ by chance as much says little.
  const TermScore wild = ScoreOfMeans({5, -3, 4, -2, 3, -4, 6, -1}, objects);
  EXPECT_LT(wild.gain_nats, 0);
  EXPECT_GT(wild.p, 0.1);
  EXPECT_LT(wild.taken_unseen, 0.5 * wild.taken);
}

TEST(ScoreSums, SeeWhereOneObjectDisagrees) {
  EXPECT_FALSE(ScoreOfMeans({1, 1, 1, 1, -1, -1, -1.2, -0.8}, {0, 0, 0, 0, 1, 1, 1, 1}).every_object);
}

TEST(RankPhotoCandidates, PutTheHiddenEffectFirst) {
  TOUCHSTONE_SECOND_TIER("repeated: every effect of photographs");
  HiddenCamera rig = SmallRig();
  rig.hidden = {{"exposure", {"stops=0.2"}}};
  const DiagnosisInput input = MakePhotoInput(rig);
  const PhotographDiagnosis diagnosis = DiagnosisOf(input);
  const auto& candidates = diagnosis.candidates;
  ASSERT_GE(candidates.size(), 12u);
  EXPECT_EQ(candidates[0].effect, "exposure");
  EXPECT_GT(candidates[0].probability, 0.9);
  ASSERT_EQ(candidates[0].parameters.size(), 1u);
  EXPECT_NEAR(candidates[0].parameters[0].value, 0.2, 0.02);
  double probability = 0;
  std::set<std::pair<std::string, engine::EffectScope>> listed;
  for (size_t n = 0; n < candidates.size(); ++n) {
    probability += candidates[n].probability;
    if (candidates[n].scope == engine::EffectScope::kRig) {
      EXPECT_TRUE(listed.insert({candidates[n].effect, candidates[n].scope}).second) << candidates[n].effect;
    }
    if (n > 0 && candidates[n].probability > 0) {
      EXPECT_LE(candidates[n].gain_nats, candidates[n - 1].gain_nats);
    }
    EXPECT_NE(candidates[n].effect, "image_field");
  }
  EXPECT_LE(probability, 1 + 1e-9);
  // Its error is what a comparison with it alone finds.
  EXPECT_NEAR(candidates[0].rmse,
              ErrorWith(input, PhotographDiagnosis(),
                        absl::StrCat("  - exposure: {stops: ", candidates[0].parameters[0].value, "}\n")),
              1e-3);
}

}  // namespace
}  // namespace touchstone::diagnosis::images
