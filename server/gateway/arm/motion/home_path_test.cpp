#include "server/gateway/arm/motion/home_path.h"

#include <absl/strings/str_format.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>

#include "server/base/test_tier.h"
#include "server/base/units.h"
#include "server/gateway/arm/motion/line_turn.h"
#include "server/gateway/arm/motion/motion_planner.h"

namespace touchstone::gateway::arm {
namespace {

// Cubes of 150 mm and boxes half as high, on a plate 75 mm below the base and 300 mm before it, as on the emulated rig.
struct Bench {
  Bench(const std::string& model, double height_m)
      : bounds{Eigen::Vector3d(-0.075, -0.075, -height_m / 2), Eigen::Vector3d(0.075, 0.075, height_m / 2)} {
    limits.box_min_m.z() = -0.075;
    calibration.flange_from_tip.translation().z() = 0.12;
    calibration.has_camera = true;
    calibration.flange_from_camera.translation() = Eigen::Vector3d(0, 0.06, 0.04);
    calibration.base_from_object["box"] =
        Eigen::Isometry3d(Eigen::Translation3d(0.30, 0, -0.075 + height_m / 2));
    kinematics = std::make_unique<UrKinematics>(UrKinematics::ForModel(model).value());
    check = std::make_unique<LineCheck>(*kinematics, limits, calibration);
    planner = MotionPlanner::Create(model, limits, calibration).value();
  }
  ArmState Home() const { return At(limits.home_rad); }
  ArmState At(const Joints& joints) const {
    ArmState state;
    state.joints_rad = joints;
    state.base_from_tip = check->TipAt(joints);
    return state;
  }

  geometry::Bounds bounds;
  std::optional<double> top_m;  // of what lies there now
  MotionLimits limits;
  calibration::Calibration calibration;
  std::unique_ptr<UrKinematics> kinematics;
  std::unique_ptr<LineCheck> check;
  std::unique_ptr<MotionPlanner> planner;
};

struct Tally {
  int ways = 0, dead_ends = 0;
  std::string first;
};

// From there home, checked anew: the lines, the joints, and that it ends there.
void Try(const Bench& bench, const ArmState& from, const std::string& where, Tally* tally) {
  ++tally->ways;
  const absl::StatusOr<HomePath> path = bench.planner->PlanHome(from, bench.top_m);
  if (!path.ok()) {
    if (tally->dead_ends++ == 0) tally->first = where + ": " + std::string(path.status().message());
    return;
  }
  Joints joints = from.joints_rad;
  Eigen::Isometry3d at = from.base_from_tip;
  int beyond = 0;
  for (const Eigen::Isometry3d& pose : path->poses) {
    ASSERT_LE(TurnRad(at, pose), kMaxLineTurnRad + 1e-5) << where;
    const absl::Status followed = bench.check->Follow(at, pose, 0.15, true, where, &joints, &beyond);
    ASSERT_TRUE(followed.ok()) << followed;
    at = pose;
  }
  for (const Joints& next : path->joints) {
    const absl::Status followed = bench.check->FollowJoints(joints, next, -1, where);
    ASSERT_TRUE(followed.ok()) << followed;
    joints = next;
  }
  ASSERT_LT(Farthest(joints, bench.limits.home_rad), 1e-9) << where;
}

// Where a stop in mid-way may leave the arm: along the lines of a plan.
void TryAlong(const Bench& bench, const ArmState& from, const PlannedTouch& plan, const std::string& where,
              Tally* tally) {
  std::vector<Eigen::Isometry3d> poses = plan.motion.transit;
  poses.push_back(plan.motion.end);
  Joints joints = from.joints_rad;
  Eigen::Isometry3d at = from.base_from_tip;
  int beyond = 0;
  for (const Eigen::Isometry3d& pose : poses) {
    const Eigen::AngleAxisd turn(at.linear().transpose() * pose.linear());
    for (const double part : {0.5, 1.0}) {
      Eigen::Isometry3d stop = at;
      stop.translation() += part * (pose.translation() - at.translation());
      stop.linear() = at.linear() * Eigen::AngleAxisd(part * turn.angle(), turn.axis()).toRotationMatrix();
      Joints there = joints;
      ASSERT_TRUE(bench.check->Follow(at, stop, 0.15, true, where, &there, &beyond).ok());
      ArmState state;
      state.base_from_tip = stop;
      state.joints_rad = there;
      Try(bench, state, where, tally);
      if (part == 1.0) joints = there;
    }
    at = pose;
  }
}

// Without optimisation or under a sanitizer the whole grid takes minutes: there a part of it has to do.
#ifdef NDEBUG
constexpr int kSpots = 4, kSides = 8;
#else
constexpr int kSpots = 1, kSides = 2;
#endif

TEST(HomePath, LeadsHomeFromEveryTouchEveryStopAndEveryFace) {
  TOUCHSTONE_SECOND_TIER("repeated: both arms, all faces, every stop");
  for (const std::string model : {"ur3", "ur3e"}) {
    Tally tally;
    int touches = 0, possible = 0;
    for (const double height_m : {0.15, 0.08}) {
      Bench bench(model, height_m);
      for (const calibration::UpFace face : calibration::kUpFaces) {
        ArmState from = bench.Home();
        bench.top_m = bench.planner->ObjectTop("box", bench.bounds, face).value();
        const Eigen::Matrix3d base_from_object =
            bench.planner->ObjectPose("box", bench.bounds, face)->linear();
        for (int spot = 0; spot < kSpots; ++spot)
          for (int roll = 0; roll < 4; ++roll)
            for (const double tilt_deg : {0.0, 25.0, 50.0}) {
              const Eigen::AngleAxisd tilt(
                  tilt_deg * kRadiansPerDegree,
                  Eigen::Vector3d(std::cos(1.7 * roll + spot), std::sin(1.7 * roll + spot), 0));
              const Eigen::Vector3d x(std::cos(kPi / 2 * roll), std::sin(kPi / 2 * roll), 0);
              const Eigen::Matrix3d object_from_base = base_from_object.transpose();
              touch::CommandedTouch touch;
              touch.target_m = object_from_base *
                               Eigen::Vector3d(spot & 1 ? 0.035 : -0.035, spot & 2 ? 0.035 : -0.035, 0.04);
              touch.approach = object_from_base * (tilt * -Eigen::Vector3d::UnitZ());
              touch.lateral = object_from_base * (tilt * x);
              ++touches;
              const auto plan = bench.planner->Plan(from, "box", bench.bounds, face, touch, "touch");
              if (!plan.ok()) continue;
              ++possible;
              const std::string where =
                  absl::StrFormat("%s, %.0f mm high, %s up, spot %d, roll %d, tilt %.0f deg", model,
                                  1e3 * height_m, calibration::UpFaceName(face), spot, roll, tilt_deg);
              TryAlong(bench, from, *plan, where, &tally);
              from.base_from_tip = plan->motion.transit.back();
              from.joints_rad = plan->start_joints_rad;
            }
      }
    }
    EXPECT_GT(possible, touches / 3) << model;
    EXPECT_EQ(tally.dead_ends, 0) << model << ": of " << tally.ways << " ways from " << possible << " of "
                                  << touches << " touches; first: " << tally.first;
  }
}

// Photographs from all round, one after the other, as `rig photos --turns` takes them.
TEST(HomePath, LeadsHomeFromEveryPhotograph) {
  TOUCHSTONE_SECOND_TIER("repeated: both arms, all views");
  for (const std::string model : {"ur3", "ur3e"}) {
    Tally tally;
    int possible = 0;
    Bench bench(model, 0.15);
    bench.top_m = 0.075;
    const Eigen::Vector3d centre(0.30, 0, 0);
    ArmState from = bench.Home();
    for (const double distance_m : {0.18, 0.25, 0.32})
      for (const double fall_deg : {0.0, 20.0, 40.0, 60.0})
        for (int side = 0; side < kSides; ++side)
          for (int turn = 0; turn < 4; ++turn) {
            const double fall = fall_deg * kRadiansPerDegree, about = side * kPi / 4;
            const Eigen::Vector3d z(-std::sin(fall) * std::cos(about), -std::sin(fall) * std::sin(about),
                                    -std::cos(fall));
            const Eigen::Vector3d right =
                z.cross(Eigen::Vector3d(std::cos(about), std::sin(about), 1e-3)).normalized();
            Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
            base_from_camera.linear() << right, z.cross(right), z;
            base_from_camera.linear() *=
                Eigen::AngleAxisd(turn * kPi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
            base_from_camera.translation() = centre - distance_m * z;
            const auto plan = bench.planner->PlanView(from, base_from_camera, "box", bench.bounds,
                                                      calibration::UpFace::kPlusZ, "view");
            if (!plan.ok()) continue;
            ++possible;
            PlannedTouch view = *plan;
            TryAlong(bench, from, view,
                     absl::StrFormat("%s, camera %.0f mm away, falling %.0f deg, side %d, turn %d", model,
                                     1e3 * distance_m, fall_deg, side, turn),
                     &tally);
            from.base_from_tip = plan->motion.end;
            from.joints_rad = plan->end_joints_rad;
          }
    EXPECT_GT(possible, 3 * kSides) << model;
    EXPECT_EQ(tally.dead_ends, 0) << model << ": of " << tally.ways << " ways from " << possible
                                  << " views; first: " << tally.first;
  }
}

}  // namespace
}  // namespace touchstone::gateway::arm
