#include "server/gateway/calibration/resting_face.h"

#include <gtest/gtest.h>

namespace touchstone::gateway::calibration {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

geometry::Bounds BoxBounds() {
  geometry::Bounds bounds;
  bounds.min_m = Vector3d(-0.01, -0.02, 0.005);
  bounds.max_m = Vector3d(0.05, 0.03, 0.035);
  return bounds;
}

Vector3d Normal(UpFace face) {
  const std::string name = UpFaceName(face);
  return (name[0] == '+' ? 1.0 : -1.0) * Vector3d::Unit(name[1] - 'x');
}

TEST(RestingFace, TheNamedFacePointsUp) {
  for (const UpFace face : kUpFaces) {
    const Isometry3d base_from_object = BaseFromObject(Isometry3d::Identity(), BoxBounds(), face);
    EXPECT_EQ(base_from_object.linear() * Normal(face), Vector3d(Vector3d::UnitZ())) << UpFaceName(face);
    EXPECT_EQ(base_from_object.linear().determinant(), 1) << UpFaceName(face);
  }
}

TEST(RestingFace, PlusZIsTheObjectAsItWasRegistered) {
  Isometry3d registered = Isometry3d::Identity();
  registered.translate(Vector3d(0.3, 0.1, 0.02)).rotate(Eigen::AngleAxisd(0.4, Vector3d::UnitZ()));
  EXPECT_TRUE(BaseFromObject(registered, BoxBounds(), UpFace::kPlusZ).isApprox(registered, 1e-15));
}

TEST(RestingFace, TheRotationIsTheLeastOneAndMinusZTurnsAboutX) {
  for (const UpFace face : {UpFace::kPlusX, UpFace::kMinusX, UpFace::kPlusY, UpFace::kMinusY}) {
    const Eigen::AngleAxisd turn(BaseFromObject(Isometry3d::Identity(), BoxBounds(), face).linear());
    EXPECT_NEAR(turn.angle(), M_PI / 2, 1e-12) << UpFaceName(face);
  }
  const Eigen::Matrix3d over = BaseFromObject(Isometry3d::Identity(), BoxBounds(), UpFace::kMinusZ).linear();
  EXPECT_EQ(over * Vector3d::UnitX(), Vector3d(Vector3d::UnitX()));
}

TEST(RestingFace, TheBoxKeepsItsCentreInThePlaneAndRestsAsHigh) {
  const geometry::Bounds box = BoxBounds();
  for (const UpFace face : kUpFaces) {
    const Isometry3d base_from_object = BaseFromObject(Isometry3d::Identity(), box, face);
    double lowest_m = 1e9;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d point_m(corner & 1 ? box.max_m.x() : box.min_m.x(),
                             corner & 2 ? box.max_m.y() : box.min_m.y(),
                             corner & 4 ? box.max_m.z() : box.min_m.z());
      lowest_m = std::min(lowest_m, (base_from_object * point_m).z());
    }
    EXPECT_NEAR(lowest_m, box.min_m.z(), 1e-15) << UpFaceName(face);
    const Vector3d moved_m = base_from_object * box.Centre() - box.Centre();
    EXPECT_NEAR(moved_m.head<2>().norm(), 0, 1e-15) << UpFaceName(face);
  }
}

TEST(RestingFace, ATiltedRegistrationTiltsEveryFaceAlike) {
  Isometry3d registered = Isometry3d::Identity();
  registered.rotate(Eigen::AngleAxisd(0.05, Vector3d::UnitX()));
  for (const UpFace face : kUpFaces) {
    const Vector3d up = BaseFromObject(registered, BoxBounds(), face).linear() * Normal(face);
    EXPECT_NEAR((up - registered.linear() * Vector3d::UnitZ()).norm(), 0, 1e-15) << UpFaceName(face);
  }
}

TEST(RestingFace, ATouchNeedsTheFaceThatItComesFrom) {
  for (const UpFace face : kUpFaces) EXPECT_EQ(UpFaceFor(-Normal(face)), face);
  EXPECT_EQ(UpFaceFor(Vector3d(0.2, 0.1, -0.97).normalized()), UpFace::kPlusZ);
  EXPECT_EQ(UpFaceFor(Vector3d(0.8, 0.1, -0.6).normalized()), UpFace::kMinusX);
}

TEST(RestingFace, OfEqualFacesTheFirstIsTakenWhateverTheRounding) {
  EXPECT_EQ(UpFaceFor(Vector3d(-1, 0, -1).normalized()), UpFace::kPlusX);
  EXPECT_EQ(UpFaceFor(Vector3d(0, 1, -1 - 1e-12).normalized()), UpFace::kMinusY);
  EXPECT_EQ(UpFaceFor(Vector3d(0, 1, -1.001).normalized()), UpFace::kPlusZ);
}

}  // namespace
}  // namespace touchstone::gateway::calibration
