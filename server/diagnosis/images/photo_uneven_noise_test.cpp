// Noise of pixels that differs between parts of a set is told as that, and no effect is named for it with confidence.
#include "server/diagnosis/images/rows/photo_uneven_noise.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/diagnosis/images/diagnose_photographs.h"
#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::images {
namespace {

// The standard deviation that pixels scatter by beyond the 2 grey levels of the set.
using MoreNoise = std::function<double(int photograph, int column, double grey)>;

DiagnosisInput InputWithMoreNoise(const MoreNoise& more) {
  HiddenCamera rig;
  rig.photographs = 6;
  rig.side_px = 224;
  auto random = std::make_shared<RandomStream>(7, RandomDomain::kTest);
  if (more)
    rig.unlisted = [=](int photograph, int column, int, const image::Photo& photo, size_t pixel) {
      return photo.grey[pixel] > 0 ? more(photograph, column, photo.grey[pixel]) * random->Normal() : 0.0;
    };
  return MakePhotoInput(rig);
}

std::optional<UnevenNoise> FoundWith(const MoreNoise& more) {
  const DiagnosisInput input = InputWithMoreNoise(more);
  const absl::StatusOr<Photographs> photographs = MakePhotographs(input, nullptr);
  EXPECT_TRUE(photographs.ok()) << photographs.status();
  const auto expected = ExpectPhotographs(*photographs, *input.model, true, nullptr);
  EXPECT_TRUE(expected.ok()) << expected.status();
  return FindUnevenNoise(*photographs, *expected, nullptr);
}

TEST(UnevenNoise, IsNotFoundWhereOneNoiseActsEverywhere) {
  EXPECT_FALSE(FoundWith(nullptr).has_value());
}

TEST(UnevenNoise, IsNotFoundWhereNoiseGrowsWithTheLightAsTheCatalogueHasIt) {
  EXPECT_FALSE(FoundWith([](int, int, double grey) { return std::sqrt(0.05 * grey); }).has_value());
}

TEST(UnevenNoise, IsFoundOfOneObjectOneStretchOneSideAndARangeOfGreyLevels) {
  const auto covariate = [](const MoreNoise& more) {
    const std::optional<UnevenNoise> found = FoundWith(more);
    return found ? found->test.name : "";
  };
  EXPECT_EQ(covariate([](int k, int, double) { return k == 4 ? 5 : 0; }), "image");
  EXPECT_EQ(covariate([](int, int column, double) { return column > 112 ? 5 : 0; }), "column");
  EXPECT_EQ(covariate([](int, int, double grey) { return grey > 120 ? 6 : 0; }), "grey");
}

TEST(UnevenNoise, OfALatePartOfTheSessionIsUnexplained) {
  const PhotographDiagnosis d =
      *DiagnosePhotographs(InputWithMoreNoise([](int k, int, double) { return 0.3 * k; }), {}, nullptr);
  EXPECT_EQ(d.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(d.unexplained.has_value());
  EXPECT_THAT(d.unexplained->words, testing::HasSubstr("Pixels scatter by an amount that depends on"));
  for (const engine::LadderStep& step : d.steps) EXPECT_LE(step.probability, 0.9) << step.effect;
}

}  // namespace
}  // namespace touchstone::diagnosis::images
