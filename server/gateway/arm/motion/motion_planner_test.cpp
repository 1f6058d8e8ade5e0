#include "server/gateway/arm/motion/motion_planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "server/base/units.h"
#include "server/gateway/arm/motion/line_check.h"
#include "server/gateway/arm/motion/line_turn.h"
#include "server/gateway/arm/motion/transit.h"
#include "server/gateway/arm/motion/ur_script.h"

namespace touchstone::gateway::arm {
namespace {

using ::testing::HasSubstr;

// A cube of 150 mm whose centre stands 100 mm high, 300 mm before the arm, as on the emulated rig.
const geometry::Bounds kCube{Eigen::Vector3d::Constant(-0.075), Eigen::Vector3d::Constant(0.075)};

calibration::Calibration Fixture() {
  calibration::Calibration calibration;
  calibration.flange_from_tip.translation().z() = 0.12;
  calibration.base_from_object["cube"] = Eigen::Isometry3d(Eigen::Translation3d(0.30, 0, 0.10));
  return calibration;
}

struct Rig {
  explicit Rig(const std::string& model, MotionLimits with = MotionLimits())
      : limits(with),
        kinematics(UrKinematics::ForModel(model).value()),
        planner(MotionPlanner::Create(model, with, Fixture()).value()),
        check(kinematics, with, Fixture()) {
    at.joints_rad = with.home_rad;
    at.base_from_tip = check.TipAt(with.home_rad);
  }
  absl::StatusOr<PlannedTouch> Plan(const touch::CommandedTouch& touch,
                                    calibration::UpFace up_face = calibration::UpFace::kPlusZ) const {
    return planner->Plan(at, "cube", kCube, up_face, touch, "touches[3]");
  }
  // As if the arm had made the touch and were back at its start.
  void Make(const PlannedTouch& plan) {
    Eigen::Isometry3d from = at.base_from_tip;
    int beyond = 0;
    for (const Eigen::Isometry3d& pose : plan.motion.transit) {
      ASSERT_TRUE(check.Follow(from, pose, 0.25, true, "it", &at.joints_rad, &beyond).ok());
      from = pose;
    }
    at.base_from_tip = from;
  }
  MotionLimits limits;
  UrKinematics kinematics;
  std::unique_ptr<MotionPlanner> planner;
  LineCheck check;
  ArmState at;
};

touch::CommandedTouch FromAbove() {
  touch::CommandedTouch touch;
  touch.target_m = Eigen::Vector3d(0, 0, 0.075);
  return touch;
}

// A touch from above, tilted and turned as far as is asked for.
touch::CommandedTouch RandomTouch(std::mt19937_64* random, double max_tilt_rad) {
  std::uniform_real_distribution<double> unit(0, 1);
  touch::CommandedTouch touch;
  touch.target_m = Eigen::Vector3d(0.09 * (unit(*random) - 0.5), 0.09 * (unit(*random) - 0.5), 0.075);
  const double towards = 2 * kPi * unit(*random), roll = 2 * kPi * unit(*random);
  const Eigen::AngleAxisd tilt(max_tilt_rad * unit(*random),
                               Eigen::Vector3d(std::cos(towards), std::sin(towards), 0));
  touch.approach = tilt * -Eigen::Vector3d::UnitZ();
  touch.lateral = tilt * Eigen::Vector3d(std::cos(roll), std::sin(roll), 0);
  return touch;
}

TEST(MotionPlanner, ReachesTheMiddleSixTenthsOfAFaceFromTwentyDegreesAndAnyRoll) {
  for (const std::string model : {"ur3", "ur3e"}) {
    Rig rig(model);
    std::mt19937_64 random(1);
    for (int i = 0; i < 200; ++i) {
      const auto plan = rig.Plan(RandomTouch(&random, 20 * kRadiansPerDegree));
      ASSERT_TRUE(plan.ok()) << model << " touch " << i << ": " << plan.status().message();
      rig.Make(*plan);
    }
  }
}

TEST(MotionPlanner, TipFrameHasItsZAlongTheApproachAndItsXAlongTheFingers) {
  const Rig rig("ur3e");
  std::mt19937_64 random(2);
  const touch::CommandedTouch touch = RandomTouch(&random, 0.3);
  const auto plan = rig.Plan(touch);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const Eigen::Isometry3d start = plan->motion.transit.back();
  EXPECT_LT((start.linear().col(2) - touch.approach).norm(), 1e-9);
  EXPECT_LT((start.linear().col(0) - touch.lateral).norm(), 1e-9);
  EXPECT_NEAR(start.linear().determinant(), 1, 1e-9);
  const Eigen::Vector3d target = Eigen::Vector3d(0.30, 0, 0.10) + touch.target_m;
  EXPECT_LT((start.translation() + 0.06 * touch.approach - target).norm(), 1e-9);
  EXPECT_LT((plan->motion.end.translation() - target - 0.03 * touch.approach).norm(), 1e-9)
      << "without a stroke of its own the approach ends stroke_beyond_target_m behind the target";
  EXPECT_GT(plan->motion.duration_s, 0.06 / touch.speed_m_s);
}

TEST(MotionPlanner, StrokeOfATouchIsItsOwn) {
  touch::CommandedTouch touch = FromAbove();
  touch.stroke_m = 0.065;
  const auto plan = Rig("ur3e").Plan(touch);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_NEAR((plan->motion.end.translation() - plan->motion.transit.back().translation()).norm(), 0.065,
              1e-9);
}

// Between two starts no fingertip comes lower than the object's top and the clearance, but on the
// lines of approach.
TEST(MotionPlanner, TransitsCrossAboveTheObject) {
  Rig rig("ur3e");
  std::mt19937_64 random(3);
  for (int i = 0; i < 50; ++i) {
    touch::CommandedTouch touch = RandomTouch(&random, 0.35);
    touch.standoff_m = 0.02;
    const auto plan = rig.Plan(touch);
    ASSERT_TRUE(plan.ok()) << plan.status();
    std::vector<Eigen::Isometry3d> path = {rig.at.base_from_tip};
    path.insert(path.end(), plan->motion.transit.begin(), plan->motion.transit.end());
    for (size_t line = 0; line + 1 < path.size(); ++line) {
      const Eigen::Vector3d along = path[line + 1].translation() - path[line].translation();
      const bool by_its_axis = along.normalized().cross(path[line + 1].linear().col(2)).norm() < 1e-6 &&
                               path[line].linear().isApprox(path[line + 1].linear(), 1e-6);
      if (by_its_axis) continue;
      for (const double part : {0.0, 0.25, 0.5, 0.75, 1.0})
        EXPECT_GT((path[line].translation() + part * along).z(), 0.175 + 0.05 - 1e-6) << "touch " << i;
    }
    rig.Make(*plan);
  }
}

// A controller that goes the other way round on a line of half a turn goes where nothing was checked.
TEST(MotionPlanner, NoLineOfATransitTurnsTheToolNearlyHalfWayRound) {
  for (const std::string model : {"ur3", "ur3e"}) {
    Rig rig(model);
    touch::CommandedTouch touch = FromAbove();
    for (const double roll_deg : {0.0, 180.0, 1.0, 180.5, 359.0, 90.0, 269.99, 30.0}) {
      const double roll_rad = roll_deg * kRadiansPerDegree;
      touch.lateral = Eigen::Vector3d(std::cos(roll_rad), std::sin(roll_rad), 0);
      const auto plan = rig.Plan(touch);
      ASSERT_TRUE(plan.ok()) << model << ", roll " << roll_deg << ": " << plan.status();
      Eigen::Isometry3d from = rig.at.base_from_tip;
      double turned_rad = 0;
      for (const Eigen::Isometry3d& pose : plan->motion.transit) {
        EXPECT_LE(TurnRad(from, pose), kMaxLineTurnRad + 1e-5) << model << ", roll " << roll_deg;
        turned_rad += TurnRad(from, pose);
        from = pose;
      }
      EXPECT_GE(turned_rad, TurnRad(rig.at.base_from_tip, from) - 1e-9);
      rig.Make(*plan);
    }
  }
}

TEST(MotionPlanner, RepeatedTouchNeedsNoTransit) {
  Rig rig("ur3");
  const auto first = rig.Plan(FromAbove());
  ASSERT_TRUE(first.ok()) << first.status();
  rig.Make(*first);
  const auto second = rig.Plan(FromAbove());
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_EQ(second->motion.transit.size(), 1u);
  EXPECT_LT(second->motion.duration_s, first->motion.duration_s);
}

void ExpectRefused(const absl::StatusOr<PlannedTouch>& plan, absl::StatusCode code,
                   const std::vector<std::string>& words) {
  ASSERT_FALSE(plan.ok());
  EXPECT_EQ(plan.status().code(), code) << plan.status();
  EXPECT_EQ(std::string(plan.status().message()).rfind("touches[3]: ", 0), 0u) << plan.status();
  for (const std::string& word : words) EXPECT_THAT(std::string(plan.status().message()), HasSubstr(word));
}

TEST(MotionPlanner, RefusesWithValueAndLimit) {
  const Rig rig("ur3e");
  touch::CommandedTouch touch = FromAbove();
  touch.speed_m_s = 0.2;
  ExpectRefused(rig.Plan(touch), absl::StatusCode::kOutOfRange, {"200 mm/s", "100 mm/s"});
  touch = FromAbove();
  touch.speed_m_s = 1e-9;
  ExpectRefused(rig.Plan(touch), absl::StatusCode::kOutOfRange, {"1e-06 mm/s", "from 0.1 to 100 mm/s"});
  touch = FromAbove();
  touch.standoff_m = 0.2;
  ExpectRefused(rig.Plan(touch), absl::StatusCode::kOutOfRange, {"standoff 200 mm", "150 mm"});
  touch = FromAbove();
  touch.target_m.x() = std::nan("");
  ExpectRefused(rig.Plan(touch), absl::StatusCode::kInvalidArgument, {"finite"});
  touch = FromAbove();
  touch.target_m.x() = 0.2;
  ExpectRefused(rig.Plan(touch), absl::StatusCode::kOutOfRange, {"x = 530.0 mm", "500.0 mm"});
  ExpectRefused(rig.Plan(FromAbove(), calibration::UpFace::kPlusX), absl::StatusCode::kFailedPrecondition,
                {"face +z up", "+x up"});
  touch = FromAbove();
  touch.stroke_m = 0.3;
  ExpectRefused(rig.Plan(touch), absl::StatusCode::kOutOfRange, {"the approach", "z = ", "0.0"});
}

TEST(MotionPlanner, RefusesTiltBeyondItsLimit) {
  MotionLimits limits;
  limits.max_tilt_rad = 10 * kRadiansPerDegree;
  touch::CommandedTouch touch = FromAbove();
  touch.approach = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) * touch.approach;
  ExpectRefused(Rig("ur3e", limits).Plan(touch), absl::StatusCode::kOutOfRange,
                {"tilted 17.2 deg", "10.0 deg"});
}

TEST(MotionPlanner, RefusesWhatTheArmCannotReach) {
  MotionLimits limits;
  limits.box_min_m = Eigen::Vector3d(-2, -2, -1), limits.box_max_m = Eigen::Vector3d(2, 2, 2);
  touch::CommandedTouch touch = FromAbove();
  touch.target_m.x() = 0.5;
  ExpectRefused(Rig("ur3", limits).Plan(touch), absl::StatusCode::kOutOfRange, {"out of reach of the ur3"});
}

TEST(MotionPlanner, RefusesJointsBeyondTheirLimits) {
  MotionLimits limits;
  limits.joint_max_rad[0] = 0.1, limits.joint_min_rad[0] = -0.1;
  touch::CommandedTouch touch = FromAbove();
  touch.target_m.y() = 0.07, touch.target_m.x() = -0.07;
  ExpectRefused(Rig("ur3e", limits).Plan(touch), absl::StatusCode::kOutOfRange,
                {"base", "its limits are -5.7 and 5.7"});
}

TEST(MotionPlanner, RefusesUnknownObjectAndNamesTheKnownOnes) {
  const Rig rig("ur3e");
  const auto plan =
      rig.planner->Plan(rig.at, "cub", kCube, calibration::UpFace::kPlusZ, FromAbove(), "touches[3]");
  ExpectRefused(plan, absl::StatusCode::kFailedPrecondition, {"'cub'", "'cube'"});
}

TEST(MotionPlanner, LimitsThatMakeNoSenseAreRefused) {
  MotionLimits limits;
  limits.payload_kg = 4;
  EXPECT_THAT(std::string(MotionPlanner::Create("ur3", limits, Fixture()).status().message()),
              HasSubstr("payload_kg = 4"));
  limits = MotionLimits();
  limits.payload_cog_m = Eigen::Vector3d(0, 0, 40);  // millimetres where metres are meant
  EXPECT_THAT(std::string(MotionPlanner::Create("ur3", limits, Fixture()).status().message()),
              HasSubstr("payload_cog_m[2] = 40"));
  limits = MotionLimits();
  limits.box_min_m.z() = 1;
  EXPECT_FALSE(MotionPlanner::Create("ur3", limits, Fixture()).ok());
  EXPECT_FALSE(MotionPlanner::Create("ur10", MotionLimits(), Fixture()).ok());
  limits = MotionLimits();
  limits.max_force_n = 10;
  EXPECT_THAT(std::string(MotionPlanner::Create("ur3", limits, Fixture()).status().message()),
              HasSubstr("max_force_n = 10: must be from 20 to 150"));
  EXPECT_TRUE(MotionPlanner::Create("ur3e", limits, Fixture()).ok());
  limits.max_force_n = 40;
  EXPECT_FALSE(MotionPlanner::Create("ur3e", limits, Fixture()).ok()) << "its sensor measures 30 N";
  limits = MotionLimits();
  limits.transit_speed_m_s = 1e-9;
  EXPECT_THAT(std::string(MotionPlanner::Create("ur3", limits, Fixture()).status().message()),
              HasSubstr("transit_speed_m_s"));
}

// Always turned the same way, the wrist would wind its cable up without end.
TEST(MotionPlanner, UnwindsTheWristBeforeItsLimit) {
  Rig rig("ur3e");
  bool unwound = false;
  for (int i = 0; i < 12; ++i) {
    touch::CommandedTouch touch = FromAbove();
    touch.lateral = Eigen::AngleAxisd(-1.9 * i, Eigen::Vector3d::UnitZ()) * touch.lateral;
    const double before_rad = rig.at.joints_rad[5];
    const auto plan = rig.Plan(touch);
    ASSERT_TRUE(plan.ok()) << i << ": " << plan.status();
    rig.Make(*plan);
    EXPECT_LE(std::abs(rig.at.joints_rad[5]), 6.2834);
    unwound = unwound || std::abs(rig.at.joints_rad[5] - before_rad) > kPi;
  }
  EXPECT_TRUE(unwound);
}

TEST(MotionPlanner, HomeLeavesTheObjectAlongTheToolsAxisFirst) {
  Rig rig("ur3e");
  std::mt19937_64 random(8);
  touch::CommandedTouch touch = RandomTouch(&random, 0.3);
  touch.standoff_m = 0.01;
  const auto plan = rig.Plan(touch);
  ASSERT_TRUE(plan.ok()) << plan.status();
  rig.Make(*plan);
  const auto home = rig.planner->PlanHome(rig.at, 0.175);
  ASSERT_TRUE(home.ok()) << home.status();
  ASSERT_FALSE(home->poses.empty());
  const Eigen::Vector3d out =
      (home->poses.front().translation() - rig.at.base_from_tip.translation()).normalized();
  EXPECT_LT((out + touch.approach).norm(), 1e-6);
  EXPECT_TRUE(home->poses.back().isApprox(rig.check.TipAt(rig.limits.home_rad), 1e-6));
}

TEST(MotionPlanner, CameraLooksFromWhereItWasAsked) {
  calibration::Calibration calibration = Fixture();
  calibration.has_camera = true;
  calibration.flange_from_camera.translation() = Eigen::Vector3d(0, 0.06, 0.04);
  const auto planner = MotionPlanner::Create("ur3e", MotionLimits(), calibration);
  ASSERT_TRUE(planner.ok());
  const Rig rig("ur3e");
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
  base_from_camera.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  base_from_camera.translation() = Eigen::Vector3d(0.30, 0, 0.40);
  const auto plan =
      (*planner)->PlanView(rig.at, base_from_camera, "cube", kCube, calibration::UpFace::kPlusZ, "view");
  ASSERT_TRUE(plan.ok()) << plan.status();
  const Eigen::Isometry3d camera =
      plan->motion.transit.back() * calibration.flange_from_tip.inverse() * calibration.flange_from_camera;
  EXPECT_TRUE(camera.isApprox(base_from_camera, 1e-9));
  EXPECT_EQ(
      rig.planner->PlanView(rig.at, base_from_camera, "cube", kCube, calibration::UpFace::kPlusZ, "view")
          .status()
          .code(),
      absl::StatusCode::kFailedPrecondition)
      << "without flange_from_camera";
}

TEST(MotionPlanner, PlansWithTheArmsOwnKinematicsOnceTheyAreKnown) {
  std::optional<DhTable> sent;
  const auto planner = MotionPlanner::Create("ur3e", MotionLimits(), Fixture(), [&] { return sent; }).value();
  EXPECT_FALSE(planner->Kinematics()->calibrated());
  const Rig published("ur3e");
  const auto nominal = published.Plan(FromAbove());
  ASSERT_TRUE(nominal.ok());

  DhTable table = published.kinematics.table();
  table[2].a_m += 3e-3, table[3].alpha_rad += 2e-3;
  table[1].d_m += 0.8, table[2].d_m -= 0.8;  // calibrations put the frames of parallel joints anywhere
  sent = table;
  ASSERT_TRUE(planner->Kinematics()->calibrated());
  const UrKinematics own = published.kinematics.Calibrated(table).value();
  ArmState at;
  at.joints_rad = MotionLimits().home_rad;
  at.base_from_tip = own.Forward(at.joints_rad) * Fixture().flange_from_tip;
  const auto plan = planner->Plan(at, "cube", kCube, calibration::UpFace::kPlusZ, FromAbove(), "touches[3]");
  ASSERT_TRUE(plan.ok()) << plan.status();
  const Eigen::Isometry3d reached = own.Forward(plan->start_joints_rad) * Fixture().flange_from_tip;
  EXPECT_LT((reached.translation() - plan->motion.transit.back().translation()).norm(), 1e-6);
  EXPECT_GT(Farthest(plan->start_joints_rad, nominal->start_joints_rad), 1e-3)
      << "as the published arm has them";

  sent = UrKinematics::ForModel("ur3")->table();
  ExpectRefused(planner->Plan(at, "cube", kCube, calibration::UpFace::kPlusZ, FromAbove(), "touches[3]"),
                absl::StatusCode::kFailedPrecondition, {"belong to a ur3", "not to a ur3e", "arm.model"});
}

TEST(MotionPlanner, ElbowWristAndCameraStayInTheArmsBox) {
  MotionLimits limits;
  limits.arm_box_max_m = Eigen::Vector3d(1, 1, 0.4);
  ExpectRefused(Rig("ur3e", limits).Plan(FromAbove()), absl::StatusCode::kOutOfRange,
                {"the arm's elbow to z = ", "ends at 400.0 mm less arm_margin_mm = 45.0 mm"});
  // A camera beside the tool meets the floor before the tip does.
  calibration::Calibration calibration = Fixture();
  calibration.has_camera = true;
  calibration.flange_from_camera.translation() = Eigen::Vector3d(0, 0, 0.115);
  limits = MotionLimits();
  limits.arm_box_min_m.z() = 0.15;
  const Rig rig("ur3e");
  const auto planner = MotionPlanner::Create("ur3e", limits, calibration).value();
  ExpectRefused(planner->Plan(rig.at, "cube", kCube, calibration::UpFace::kPlusZ, FromAbove(), "touches[3]"),
                absl::StatusCode::kOutOfRange, {"the approach", "camera", "begins at 150.0 mm"});
}

TEST(MotionPlanner, NoPartOfTheArmIsFasterThanItMay) {
  MotionLimits limits;
  limits.max_arm_speed_m_s = 0.05;
  touch::CommandedTouch touch = FromAbove();
  touch.speed_m_s = 0.08;
  ExpectRefused(Rig("ur3e", limits).Plan(touch), absl::StatusCode::kOutOfRange,
                {"the approach at 80.0 mm/s", "at most 50 mm/s (max_arm_speed_mm_s)"});
}

TEST(MotionPlanner, TellsOfTheSingularityThatAPlanComesNearTo) {
  const Rig rig("ur3e");
  const auto plain = rig.Plan(FromAbove());
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_THAT(plain->notes, ::testing::IsEmpty());
  // Far out the elbow is nearly stretched.
  touch::CommandedTouch touch = FromAbove();
  bool told = false;
  for (touch.target_m.x() = 0; touch.target_m.x() < 0.2; touch.target_m.x() += 0.002) {
    const auto plan = rig.Plan(touch);
    if (!plan.ok()) break;
    for (const std::string& note : plan->notes)
      told = told || note.find("near the elbow singularity: the elbow is ") != std::string::npos;
  }
  EXPECT_TRUE(told);
}

}  // namespace
}  // namespace touchstone::gateway::arm
