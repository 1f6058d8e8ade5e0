#include "server/diagnosis/residuals/touches/describe_residuals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

ResidualSummary Describe(const touches::SyntheticSet& set) {
  return DescribeResiduals(set.observations, set.prediction, set.prediction, set.residuals, set.residuals,
                           {touches::kSyntheticSigmaS, 0.03, 0});
}

TEST(ResidualPlots, AreThinnedAndParityDiffersByTheResidual) {
  const touches::SyntheticSet set = touches::EarlyOnSlopes();
  const ResidualSummary summary = Describe(set);
  EXPECT_EQ(summary.parity.size(), 2000u);
  double squares = 0;
  for (const ParityPoint& point : summary.parity)
    squares += std::pow(point.measured_s - point.simulated_s, 2);
  double all = 0;
  for (const double r : set.residuals) all += r * r;
  EXPECT_NEAR(std::sqrt(squares / 2000), std::sqrt(all / set.residuals.size()), 0.0003);
  EXPECT_EQ(summary.surface_points.size(), 5u * 48 * 3);  // repeats share a spot
}

TEST(ResidualPlots, OutlinesAreCoarseCopies) {
  touches::SyntheticSet set(1, 4, 2, touches::kSyntheticSigmaS, 7);
  geometry::TriangleMesh sphere;  // an octahedron divided five times: 8192 triangles, radius 50 mm
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
  set.observations.surfaces[0] = *geometry::Surface::Create("ball", sphere);
  const ResidualSummary summary = Describe(set);
  ASSERT_EQ(summary.outlines.size(), 1u);
  const geometry::TriangleMesh& outline = summary.outlines[0].mesh;
  EXPECT_LE(outline.triangles.size(), 400u);
  EXPECT_GE(outline.triangles.size(), 150u);
  for (const Eigen::Vector3f& vertex : outline.vertices_m) EXPECT_NEAR(vertex.norm(), 0.048, 0.003);
  for (const auto& triangle : outline.triangles)
    for (const uint32_t corner : triangle) EXPECT_LT(corner, outline.vertices_m.size());
}

TEST(DescribeResiduals, SaysTheSameTwice) {
  const touches::SyntheticSet set = touches::EarlyOnSlopes();
  const ResidualSummary once = Describe(set), twice = Describe(set);
  ASSERT_EQ(once.slices.size(), twice.slices.size());
  ASSERT_EQ(once.curves.size(), twice.curves.size());
  ASSERT_EQ(once.histograms.size(), twice.histograms.size());
  ASSERT_EQ(once.surface_points.size(), twice.surface_points.size());
  for (size_t n = 0; n < once.slices.size(); ++n) {
    EXPECT_EQ(once.slices[n].conditions, twice.slices[n].conditions);
    EXPECT_EQ(once.slices[n].mean_residual_s, twice.slices[n].mean_residual_s);
  }
  for (size_t n = 0; n < once.curves.size(); ++n) EXPECT_EQ(once.curves[n].p_value, twice.curves[n].p_value);
  for (size_t n = 0; n < once.histograms.size(); ++n) {
    EXPECT_EQ(once.histograms[n].p_simulated, twice.histograms[n].p_simulated);
    EXPECT_EQ(once.histograms[n].simulated, twice.histograms[n].simulated);
  }
  for (size_t n = 0; n < once.surface_points.size(); ++n)
    EXPECT_EQ(once.surface_points[n].residual_s, twice.surface_points[n].residual_s);
}

TEST(DescribeResiduals, ShowsAPartOfManyTouches) {
  TOUCHSTONE_SECOND_TIER("long: a hundred thousand touches");
  const touches::SyntheticSet set(5, 1000, 12, touches::kSyntheticSigmaS, 8);
  const ResidualSummary summary = Describe(set);
  EXPECT_EQ(summary.parity.size(), 2000u);
  EXPECT_LE(summary.surface_points.size(), 4000u);
}

TEST(DescribeResiduals, WithoutTimesGivesAnEmptySummary) {
  touches::SyntheticSet set(1, 2, 1, touches::kSyntheticSigmaS, 9);
  for (double& time_s : set.observations.time_s) time_s = NAN;
  set.Finish();
  const ResidualSummary summary = Describe(set);
  EXPECT_THAT(summary.slices, testing::IsEmpty());
  EXPECT_THAT(summary.grouped.groups, testing::IsEmpty());
  EXPECT_THAT(summary.worst_touches, testing::IsEmpty());
  EXPECT_THAT(summary.parity, testing::IsEmpty());
  EXPECT_THAT(summary.histograms, testing::IsEmpty());
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
