#include <gtest/gtest.h>

#include "server/gateway/calibration/calibration.h"

namespace touchstone {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Bounds Box() {
  Bounds bounds;
  bounds.min_m = Vector3d(-0.01, -0.02, 0.005);
  bounds.max_m = Vector3d(0.05, 0.03, 0.035);
  return bounds;
}

Vector3d Normal(const std::string& placement) {
  return (placement[0] == '+' ? 1.0 : -1.0) * Vector3d::Unit(placement[1] - 'x');
}

TEST(Placement, TheNamedFacePointsUp) {
  for (const std::string& placement : Placements()) {
    const Isometry3d base_from_object = BaseFromObject(Isometry3d::Identity(), Box(), placement);
    EXPECT_EQ(base_from_object.linear() * Normal(placement), Vector3d(Vector3d::UnitZ())) << placement;
    EXPECT_EQ(base_from_object.linear().determinant(), 1) << placement;
  }
}

TEST(Placement, PlusZIsTheObjectAsItWasRegistered) {
  Isometry3d registered = Isometry3d::Identity();
  registered.translate(Vector3d(0.3, 0.1, 0.02)).rotate(Eigen::AngleAxisd(0.4, Vector3d::UnitZ()));
  EXPECT_TRUE(BaseFromObject(registered, Box(), "+z").isApprox(registered, 1e-15));
}

TEST(Placement, TheRotationIsTheLeastOneAndMinusZTurnsAboutX) {
  for (const char* placement : {"+x", "-x", "+y", "-y"}) {
    const Eigen::AngleAxisd turn(BaseFromObject(Isometry3d::Identity(), Box(), placement).linear());
    EXPECT_NEAR(turn.angle(), M_PI / 2, 1e-12) << placement;
  }
  const Eigen::Matrix3d over = BaseFromObject(Isometry3d::Identity(), Box(), "-z").linear();
  EXPECT_EQ(over * Vector3d::UnitX(), Vector3d(Vector3d::UnitX()));
}

TEST(Placement, TheBoxKeepsItsCentreInThePlaneAndRestsAsHigh) {
  const Bounds box = Box();
  for (const std::string& placement : Placements()) {
    const Isometry3d base_from_object = BaseFromObject(Isometry3d::Identity(), box, placement);
    double lowest_m = 1e9;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d point_m(corner & 1 ? box.max_m.x() : box.min_m.x(),
                             corner & 2 ? box.max_m.y() : box.min_m.y(),
                             corner & 4 ? box.max_m.z() : box.min_m.z());
      lowest_m = std::min(lowest_m, (base_from_object * point_m).z());
    }
    EXPECT_NEAR(lowest_m, box.min_m.z(), 1e-15) << placement;
    const Vector3d moved_m = base_from_object * box.Centre() - box.Centre();
    EXPECT_NEAR(moved_m.head<2>().norm(), 0, 1e-15) << placement;
  }
}

TEST(Placement, ATiltedRegistrationTiltsEveryPlacementAlike) {
  Isometry3d registered = Isometry3d::Identity();
  registered.rotate(Eigen::AngleAxisd(0.05, Vector3d::UnitX()));
  for (const std::string& placement : Placements()) {
    const Vector3d up = BaseFromObject(registered, Box(), placement).linear() * Normal(placement);
    EXPECT_NEAR((up - registered.linear() * Vector3d::UnitZ()).norm(), 0, 1e-15) << placement;
  }
}

TEST(Placement, ATouchNeedsTheFaceThatItComesFrom) {
  for (const std::string& placement : Placements()) EXPECT_EQ(PlacementFor(-Normal(placement)), placement);
  EXPECT_EQ(PlacementFor(Vector3d(0.2, 0.1, -0.97).normalized()), "+z");
  EXPECT_EQ(PlacementFor(Vector3d(0.8, 0.1, -0.6).normalized()), "-x");
}

TEST(Placement, OfEqualFacesTheFirstIsTakenWhateverTheRounding) {
  EXPECT_EQ(PlacementFor(Vector3d(-1, 0, -1).normalized()), "+x");
  EXPECT_EQ(PlacementFor(Vector3d(0, 1, -1 - 1e-12).normalized()), "-y");
  EXPECT_EQ(PlacementFor(Vector3d(0, 1, -1.001).normalized()), "+z");
}

}  // namespace
}  // namespace touchstone
