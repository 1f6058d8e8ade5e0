#include "server/diagnosis/images/photo_hypotheses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::diagnosis::images {
namespace {

using P = PhotoHypothesis;

// Which of the rows are asked where those of `true_ones` are found.
std::vector<int> AskedOfPhotographs(const std::vector<int>& true_ones) {
  engine::Hypotheses found(PhotoHypothesisRules());
  std::vector<int> asked;
  engine::Hypotheses::Questions questions;
  for (const engine::HypothesisRule& rule : PhotoHypothesisRules())
    questions[rule.hypothesis] = [&, hypothesis = rule.hypothesis] {
      asked.push_back(hypothesis);
      return found.AddIf(std::count(true_ones.begin(), true_ones.end(), hypothesis) > 0, hypothesis);
    };
  EXPECT_TRUE(found.Ask(questions).ok());
  return asked;
}

TEST(PhotoHypothesisRules, StandInTheOrderOfTheEnumeration) {
  for (size_t i = 0; i < PhotoHypothesisRules().size(); ++i)
    EXPECT_EQ(static_cast<size_t>(PhotoHypothesisRules()[i].hypothesis), i) << PhotoHypothesisRules()[i].name;
  EXPECT_EQ(static_cast<size_t>(P::kUnknown) + 1, PhotoHypothesisRules().size());
}

TEST(PhotoHypothesisRules, AlbedoAndImageFieldTakeNoPartBesideALargeStep) {
  const std::vector<int> asked = AskedOfPhotographs({P::kLargeStep});
  EXPECT_THAT(asked, testing::Not(testing::Contains(P::kAlbedo)));
  EXPECT_THAT(asked, testing::Not(testing::Contains(P::kImageField)));
  EXPECT_THAT(asked, testing::Contains(P::kMisfit));
}

TEST(PhotoHypothesisRules, OnlyAMisfitOfWhichNothingIsKnownIsUnknown) {
  EXPECT_EQ(AskedOfPhotographs({P::kMisfit}).back(), P::kUnknown);
  for (const int known : {P::kDependence, P::kSuggestion, P::kKindOfRest, P::kUnevenNoise})
    EXPECT_EQ(AskedOfPhotographs({P::kMisfit, known}).back(), P::kUnevenNoise);
}

TEST(PhotoHypothesisRules, UnevenNoiseIsSaidAfterTheKindOfTheRest) {
  engine::Hypotheses found(PhotoHypothesisRules());
  found.Add(P::kUnevenNoise, "Noisier on the left.");
  EXPECT_EQ(found.Words(), "Noisier on the left.");
  found.Add(P::kKindOfRest, "Dirt.");
  EXPECT_EQ(found.Words(), "Dirt. Noisier on the left.");
}

}  // namespace
}  // namespace touchstone::diagnosis::images
