#include "server/diagnosis/residuals/distribution/histograms.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

std::vector<ComparedHistogram> Histograms(const touches::SyntheticSet& set, uint64_t seed = 0) {
  return MakeHistograms(set.observations, set.prediction, set.prediction,
                        {touches::kSyntheticSigmaS, 0.03, seed});
}

TEST(ResidualHistograms, OfARightModelAgree) {
  const touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 5);
  const auto right = Histograms(set);
  EXPECT_EQ(right.size(), 12u);  // two quantities, five objects and all
  int small = 0;
  for (const ComparedHistogram& histogram : right) {
    EXPECT_LE(histogram.measured.size(), 60u);
    EXPECT_EQ(histogram.edges.size(), histogram.measured.size() + 1);
    small += histogram.p_simulated < 0.02;
    double integral = 0;
    for (const double density : histogram.measured) integral += density;
    EXPECT_NEAR(integral * (histogram.edges[1] - histogram.edges[0]), 1, 0.01);
  }
  EXPECT_LE(small, 2);
}

TEST(ResidualHistograms, SeeAShiftOfTheMiddleFingerInTheCurvature) {
  touches::SyntheticSet set(5, 48, 4, touches::kSyntheticSigmaS, 6);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 1] -= 20 * touches::kSyntheticSigmaS;
  set.Finish();
  touches::SyntheticSet true_set = set;
  for (int k = 0; k < set.size(); ++k)
    true_set.prediction.time_s[k * 3 + 1] -= 20 * touches::kSyntheticSigmaS;
  true_set.Finish();
  const auto histograms = MakeHistograms(set.observations, set.prediction, true_set.prediction,
                                         {touches::kSyntheticSigmaS, 0.03, 0});
  for (const ComparedHistogram& histogram : histograms) {
    if (histogram.quantity != HistogramQuantity::kCurvature || !histogram.object.empty()) continue;
    EXPECT_LT(histogram.p_simulated, 1e-3);
    EXPECT_GT(histogram.p_improved, 0.01);
  }
}

TEST(ResidualHistograms, AreCalibrated) {
  int small = 0;
  for (int seed = 0; seed < 60; ++seed) {
    const auto made =
        Histograms(touches::SyntheticSet(1, 48, 4, touches::kSyntheticSigmaS, 300 + seed), seed);
    for (const ComparedHistogram& histogram : made) small += histogram.p_simulated < 0.1;
  }
  EXPECT_GE(small, 2);  // 120 tests at 0.1: 12 are expected
  EXPECT_LE(small, 24);
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
