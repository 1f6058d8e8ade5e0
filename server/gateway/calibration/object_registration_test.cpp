#include "server/gateway/calibration/object_registration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/units.h"

namespace touchstone::gateway::calibration {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

// A box 100 x 60 x 40 mm that rests on z = 0.
std::shared_ptr<const geometry::Surface> Box() {
  geometry::TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner)
    mesh.vertices_m.emplace_back(corner & 1 ? 0.05f : -0.05f, corner & 2 ? 0.03f : -0.03f,
                                 corner & 4 ? 0.04f : 0.0f);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return *geometry::Surface::Create("box", std::move(mesh));
}

Isometry3d Truth() {
  Isometry3d pose = Isometry3d::Identity();
  pose.translate(Vector3d(0.3, -0.1, 0.02));
  pose.rotate(Eigen::AngleAxisd(0.35, Vector3d(0.02, -0.03, 1).normalized()));
  return pose;
}

Isometry3d Off(const Isometry3d& pose, const Vector3d& shift_m, const Vector3d& turn_rad) {
  Isometry3d off = pose;
  off.translation() += shift_m;
  if (turn_rad.norm() > 0)
    off.linear() =
        Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized()).toRotationMatrix() * off.linear();
  return off;
}

// Contacts on the top and two sides (or the top alone), with noise along the approach.
std::vector<RegistrationContact> Touch(const geometry::Surface& surface, size_t count, double noise_m,
                                       RandomStream* random, bool top_only = false) {
  const Isometry3d truth = Truth();
  std::vector<RegistrationContact> contacts;
  while (contacts.size() < count) {
    const size_t face = top_only ? 0 : contacts.size() % 3;
    Vector3d normal = Vector3d::UnitZ();
    if (face == 1) normal = Vector3d::UnitX();
    if (face == 2) normal = -Vector3d::UnitY();
    // Slightly oblique, as a planned touch is.
    const Vector3d approach =
        (-normal + 0.2 * Vector3d(random->Uniform(-1, 1), random->Uniform(-1, 1), random->Uniform(-1, 1)))
            .normalized();
    const Vector3d near_m(random->Uniform(-0.04, 0.04), random->Uniform(-0.02, 0.02),
                          random->Uniform(0.01, 0.03));
    geometry::Contacts hit;
    const Vector3d origin_m = near_m - 0.2 * approach;
    surface.CastLines({&origin_m, 1}, {&approach, 1}, 1, &hit);
    if (std::isnan(hit.travel_m[0])) continue;
    RegistrationContact contact;
    contact.finger_x_m = 0.03 * (static_cast<double>(contacts.size() % 3) - 1);
    const Vector3d point_m =
        truth * hit.point_m[0] + noise_m * random->Normal() * (truth.linear() * approach);
    contact.base_from_tip.linear() =
        Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), truth.linear() * approach).toRotationMatrix();
    contact.base_from_tip.translation() =
        point_m - contact.base_from_tip.linear() * Vector3d(contact.finger_x_m, 0, 0);
    contacts.push_back(contact);
  }
  return contacts;
}

TEST(ObjectRegistration, FindsThePoseFromAStartFiveMillimetresAndThreeDegreesOff) {
  const auto surface = Box();
  for (int round = 0; round < 40; ++round) {
    RandomStream random(1, RandomDomain::kTest, round);
    const auto contacts = Touch(*surface, 36, 0, &random);
    const Vector3d shift(random.Normal(), random.Normal(), random.Normal());
    const Vector3d turn(random.Normal(), random.Normal(), random.Normal());
    const auto found =
        RegisterObject(*surface, contacts,
                       Off(Truth(), 0.005 * shift.normalized(), 3 * kRadiansPerDegree * turn.normalized()));
    ASSERT_TRUE(found.ok()) << "round " << round << ": " << found.status();
    // The mesh is in single precision.
    EXPECT_NEAR((found->base_from_object.matrix() - Truth().matrix()).norm(), 0, 1e-6) << "round " << round;
    EXPECT_LT(found->rms_m, 1e-7);
  }
}

TEST(ObjectRegistration, StandardErrorsAreThoseOfTheNoise) {
  constexpr int kRounds = 200;
  constexpr double kNoiseM = 50e-6;
  const auto surface = Box();
  double shift_squares = 0, turn_squares = 0, variance = 0;
  for (int round = 0; round < kRounds; ++round) {
    RandomStream random(2, RandomDomain::kTest, round);
    const auto contacts = Touch(*surface, 45, kNoiseM, &random);
    const auto found =
        RegisterObject(*surface, contacts, Off(Truth(), Vector3d(0.001, 0, 0.001), Vector3d::Zero()));
    ASSERT_TRUE(found.ok()) << found.status();
    const Eigen::AngleAxisd turn(found->base_from_object.linear() * Truth().linear().transpose());
    for (int k = 0; k < 3; ++k) {
      const double shift_m = found->base_from_object.translation()[k] - Truth().translation()[k];
      shift_squares += std::pow(shift_m / found->translation_std_error_m[k], 2) / 3;
      turn_squares += std::pow(turn.angle() * turn.axis()[k] / found->rotation_std_error_rad[k], 2) / 3;
    }
    variance += found->rms_m * found->rms_m;
  }
  EXPECT_NEAR(shift_squares / kRounds, 1, 0.25);
  EXPECT_NEAR(turn_squares / kRounds, 1, 0.25);
  EXPECT_NEAR(std::sqrt(variance / kRounds), kNoiseM, 0.05 * kNoiseM);
}

TEST(ObjectRegistration, AFewFalseContactsDoNotPullIt) {
  const auto surface = Box();
  RandomStream random(3, RandomDomain::kTest);
  auto contacts = Touch(*surface, 40, 20e-6, &random);
  contacts[4].base_from_tip.translate(Vector3d(0, 0, 0.004));
  contacts[11].base_from_tip.translate(Vector3d(0, 0, -0.006));
  const auto found =
      RegisterObject(*surface, contacts, Off(Truth(), Vector3d(0.002, -0.002, 0.002), Vector3d::Zero()));
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_NEAR((found->base_from_object.translation() - Truth().translation()).norm(), 0, 1e-4);
  EXPECT_GE(found->left_out, 2u);
  EXPECT_LE(found->left_out, 5u);
}

TEST(ObjectRegistration, NamesWhatAFlatFaceCannotTell) {
  const auto surface = Box();
  RandomStream random(4, RandomDomain::kTest);
  const auto found = RegisterObject(*surface, Touch(*surface, 40, 20e-6, &random, true), Truth());
  ASSERT_FALSE(found.ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(found.status()));
  EXPECT_THAT(std::string(found.status().message()), HasSubstr("cannot determine 3 of 6 directions"));
  EXPECT_THAT(std::string(found.status().message()), HasSubstr("turn about z"));
  EXPECT_THAT(std::string(found.status().message()), HasSubstr("shift along x"));
}

TEST(ObjectRegistration, RefusesTooFewContactsAndAnotherObject) {
  const auto surface = Box();
  RandomStream random(5, RandomDomain::kTest);
  auto contacts = Touch(*surface, 6, 0, &random);
  EXPECT_THAT(std::string(RegisterObject(*surface, contacts, Truth()).status().message()),
              HasSubstr("has 6 contacts"));
  contacts = Touch(*surface, 30, 0, &random);
  for (RegistrationContact& contact : contacts)
    contact.base_from_tip.translation() += 0.01 * Vector3d(random.Normal(), random.Normal(), random.Normal());
  EXPECT_TRUE(absl::IsFailedPrecondition(RegisterObject(*surface, contacts, Truth()).status()));
  contacts[2].base_from_tip.translation().x() = NAN;
  EXPECT_THAT(std::string(RegisterObject(*surface, contacts, Truth()).status().message()),
              HasSubstr("contact 2"));
}

}  // namespace
}  // namespace touchstone::gateway::calibration
