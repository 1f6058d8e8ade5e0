#include "server/touch/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <set>

#include "server/base/units.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::touch {
namespace {

geometry::Bounds Box() {
  geometry::Bounds bounds;
  bounds.min_m = {-0.1, -0.05, -0.02};
  bounds.max_m = {0.2, 0.05, 0.06};
  return bounds;
}

std::vector<TouchPose> DrawPoses(const Plan& plan, int count, uint64_t seed = 1) {
  std::vector<uint64_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0);
  std::vector<TouchPose> poses(count);
  MakePoseGenerator(plan, Box(), seed)->Draw(numbers, 0, poses.data());
  return poses;
}

TEST(SpherePlan, StartsOnTheSphereRoundTheBoxAndAimsAtItsCentre) {
  Plan plan;
  plan.sphere.roll_step_rad = 15 * kRadiansPerDegree;
  for (const TouchPose& pose : DrawPoses(plan, 500)) {
    const Eigen::Vector3d start = pose.target_m - pose.approach * pose.standoff_m;
    EXPECT_NEAR((start - Box().Centre()).norm(), 1.05 * 0.5 * Box().DiagonalM(), 1e-12);
    EXPECT_EQ(pose.target_m, Box().Centre());
    EXPECT_NEAR(pose.approach.dot(pose.lateral), 0, 1e-12);
    EXPECT_NEAR(pose.lateral.norm(), 1, 1e-12);
  }
}

TEST(SpherePlan, AnObjectThatComesAgainSharesItsGenerator) {
  const auto surface = [] {
    return *geometry::Surface::Create("lat20",
                                      *geometry::MakeSupershape(*geometry::NamedSupershape("lat20"), 500));
  };
  const auto one = surface(), other = surface();
  Plan plan;
  const auto generators = MakePoseGenerators(plan, {one, other, one, one}, 7);
  ASSERT_EQ(generators.size(), 4u);
  EXPECT_EQ(generators[2], generators[0]);
  EXPECT_EQ(generators[3], generators[0]);
  EXPECT_NE(generators[1], generators[0]);
  const uint64_t number = 17;
  TouchPose shared, own;
  generators[1]->Draw({&number, 1}, 0, &shared);
  MakePoseGenerator(plan, *other, 7)->Draw({&number, 1}, 0, &own);
  EXPECT_EQ(shared.approach, own.approach);
  EXPECT_EQ(shared.target_m, own.target_m);
}

TEST(SpherePlan, AnglesAreMultiplesOfTheStep) {
  Plan plan;
  plan.sphere.step_angle_rad = 30 * kRadiansPerDegree;
  std::set<std::pair<int, int>> seen;
  for (const TouchPose& pose : DrawPoses(plan, 5000)) {
    const double phi_deg = std::asin(std::clamp(-pose.approach.z(), -1.0, 1.0)) / kRadiansPerDegree;
    EXPECT_NEAR(phi_deg, 30 * std::round(phi_deg / 30), 1e-5);
    // theta shows in the lateral even at the poles: lateral = (-sin theta, cos theta, 0).
    const double theta_deg = std::atan2(-pose.lateral.x(), pose.lateral.y()) / kRadiansPerDegree;
    EXPECT_NEAR(theta_deg, 30 * std::round(theta_deg / 30), 1e-6);
    seen.insert({std::lround(theta_deg), std::lround(phi_deg)});
  }
  EXPECT_GE(seen.size(), 12u * 7u);
}

TEST(SpherePlan, LateralPointsRightInTheImageSoThatUpIsUp) {
  for (const TouchPose& pose : DrawPoses(Plan(), 500)) {
    EXPECT_NEAR((pose.approach.cross(Eigen::Vector3d::UnitZ()) -
                 pose.lateral * std::hypot(pose.approach.x(), pose.approach.y()))
                    .norm(),
                0, 1e-12);
    EXPECT_GE(pose.lateral.cross(pose.approach).z(), -1e-12);
  }
}

TEST(SpherePlan, AttemptsDifferAndRepeatExactly) {
  Plan plan;
  const auto generator = MakePoseGenerator(plan, Box(), 5);
  const uint64_t number = 17;
  TouchPose first, second, again;
  generator->Draw({&number, 1}, 0, &first);
  generator->Draw({&number, 1}, 1, &second);
  generator->Draw({&number, 1}, 0, &again);
  EXPECT_NE(first.approach, second.approach);
  EXPECT_EQ(first.approach, again.approach);
}

TEST(FacesPlan, TargetsLieOnTheirFacesWithinTheSpreadAndTheTiltIsBounded) {
  Plan plan;
  plan.kind = Plan::Kind::kFaces;
  const std::vector<TouchPose> poses = DrawPoses(plan, 48);
  for (int n = 0; n < 48; ++n) {
    const int face = n / 8, axis = face / 2;
    const Eigen::Vector3d offset = poses[n].target_m - Box().Centre();
    const Eigen::Vector3d half = 0.5 * (Box().max_m - Box().min_m);
    EXPECT_NEAR(offset[axis], (face % 2 == 0 ? 1 : -1) * half[axis], 1e-15);
    EXPECT_LE(std::abs(offset[(axis + 1) % 3]), 0.6 * half[(axis + 1) % 3]);
    EXPECT_GE(-poses[n].approach[axis] * (face % 2 == 0 ? 1 : -1), std::cos(20 * kRadiansPerDegree) - 1e-12);
    EXPECT_NEAR(poses[n].approach.dot(poses[n].lateral), 0, 1e-12);
  }
}

TEST(FacesPlan, EveryRoundRepeatsTheSamePoses) {
  Plan plan;
  plan.kind = Plan::Kind::kFaces;
  EXPECT_EQ(MakePoseGenerator(plan, Box(), 1)->Count(), 192u);
  const std::vector<TouchPose> poses = DrawPoses(plan, 96);
  for (int n = 0; n < 48; ++n) EXPECT_EQ(poses[n].approach, poses[n + 48].approach);
}

TEST(Plan, RefusesWhatMakesNoSenseByName) {
  Plan empty;
  empty.kind = Plan::Kind::kList;
  EXPECT_THAT(std::string(ValidatePlan(&empty).message()), testing::HasSubstr("at least one touch"));
  Plan coarse;
  coarse.sphere.step_angle_rad = 4;
  EXPECT_THAT(std::string(ValidatePlan(&coarse).message()), testing::HasSubstr("sphere.step_angle_rad = 4"));
  Plan still;
  still.speed_m_s = NAN;
  EXPECT_THAT(std::string(ValidatePlan(&still).message()), testing::HasSubstr("speed_m_s = nan"));
}

}  // namespace
}  // namespace touchstone::touch
