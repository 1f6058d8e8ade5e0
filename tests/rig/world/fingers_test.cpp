#include "tests/rig/world/fingers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/rig/world/hidden_physics.h"

namespace touchstone::rig {
namespace {

using Vec = Eigen::Vector3d;

// A box of 150 x 100 x 60 mm about the origin of its mesh.
std::shared_ptr<const hidden::Solid> Box() {
  hidden::Triangles box;
  for (int k = 0; k < 8; ++k)
    box.vertices_mm.push_back(Vec(k & 1 ? 75 : -75, k & 2 ? 50 : -50, k & 4 ? 30 : -30));
  box.corners = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                 {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return std::make_shared<hidden::Solid>("box", box);
}

// Fingers with a box that lies with its centre at (0.3, 0, 0.1), and an arm that moves as it is told.
class Bench {
 public:
  explicit Bench(const std::vector<std::string>& hide, double sigma_us = 0, uint64_t seed = 1) {
    scenario_.objects = {Box()};
    scenario_.sigma_us = sigma_us;
    for (const std::string& each : hide) Hide(each, &scenario_);
    fingers_ = std::make_unique<Fingers>(scenario_, seed,
                                         std::map<std::string, Eigen::Isometry3d>{
                                             {"box", Eigen::Isometry3d(Eigen::Translation3d(0.3, 0, 0.1))}},
                                         &faults_, [this](const Edge& edge) { edges_.push_back(edge); });
    EXPECT_EQ(fingers_->Mount("box", "+z"), "");
  }

  // The tip at `at`, its z tilted by so much from straight down, about the base's y; x as the base's
  // for no tilt.
  static Eigen::Isometry3d Tip(const Vec& at, double tilt_rad = 0) {
    Eigen::Isometry3d tip = Eigen::Isometry3d::Identity();
    tip.translation() = at;
    tip.linear() = (Eigen::AngleAxisd(tilt_rad, Vec::UnitY()) * Eigen::AngleAxisd(M_PI, Vec::UnitX()))
                       .toRotationMatrix();
    return tip;
  }

  // A straight motion with a ramp from rest, in cycles of 2 ms; stops after `stop_m`. Returns
  // the greatest push.
  double Move(const Eigen::Isometry3d& from, const Vec& way, double speed_m_s, double stop_m = 1e9) {
    constexpr double kAcceleration = 1.2;
    StraightMotion motion;
    motion.number = ++number_, motion.start_s = now_s_ + 0.5;
    motion.from = motion.to = from;
    motion.to.translation() += way;
    motion.speed_m_s = speed_m_s, motion.acceleration_m_s2 = kAcceleration;
    const double ramp_s = speed_m_s / kAcceleration, length_m = std::min(way.norm(), stop_m);
    const auto distance_at = [&](double at_s) {
      const double t = at_s - motion.start_s;
      return std::min(length_m, t < ramp_s ? 0.5 * kAcceleration * t * t : speed_m_s * (t - ramp_s / 2));
    };
    fingers_->OnMotionBegan(motion);
    double push_m = 0;
    for (now_s_ = motion.start_s;; now_s_ += 0.002) {
      push_m =
          std::max(push_m, fingers_->OnProgress(motion.number, now_s_, distance_at(now_s_), distance_at));
      if (distance_at(now_s_) >= length_m) break;
    }
    fingers_->OnMotionEnded(motion.number, now_s_);
    ended_at_ = motion.from;
    ended_at_.translation() += way.normalized() * length_m;
    return push_m;
  }
  // Straight down onto the upper face, and back.
  TouchTruth Touch(double x = 0.3, double tilt_rad = 0, double down_m = 0.08, double speed_m_s = 0.02) {
    const Eigen::Isometry3d start = Tip(Vec(x, 0, 0.18), tilt_rad);
    Move(start, start.linear().col(2) * down_m, speed_m_s);
    const TouchTruth truth = fingers_->Touches().empty() ? TouchTruth() : fingers_->Touches().back();
    Move(ended_at_, -start.linear().col(2) * down_m, 0.1);
    return truth;
  }

  hidden::Scenario scenario_;
  Faults faults_;
  std::vector<Edge> edges_;
  std::unique_ptr<Fingers> fingers_;
  uint64_t number_ = 0;
  double now_s_ = 3;
  Eigen::Isometry3d ended_at_;
};

constexpr double kRampLossS = 0.02 / 1.2 / 2;  // a ramp from rest to 20 mm/s costs so much

TEST(Fingers, TouchAPlaneWhereGeometrySaysAfterTheRamp) {
  Bench bench({});
  const double tilt = 10 * M_PI / 180;
  const TouchTruth truth = bench.Touch(0.3, tilt);
  ASSERT_EQ(truth.number, 1u);
  // Upper face at z = 0.13; the tip's x is tilted too, so finger i starts x_i sin(tilt) lower or higher.
  for (int i = 0; i < 3; ++i) {
    const Eigen::Isometry3d start = Bench::Tip(Vec(0.3, 0, 0.18), tilt);
    const double z = (start * Vec((i - 1) * 0.03, 0, 0)).z();
    const double travel_m = (z - 0.13) / std::cos(tilt);
    EXPECT_NEAR(truth.travel_m[i], travel_m, 1e-9) << i;
    EXPECT_NEAR(truth.contact_s[i], travel_m / 0.02 + kRampLossS, 1e-8) << i;
    EXPECT_NEAR(truth.reported_s[i], truth.contact_s[i], 1e-12) << i;
  }
  EXPECT_NEAR((truth.start_in_object_m - Vec(0, 0, 0.08)).norm(), 0, 1e-9);
}

TEST(Fingers, PressAndReleaseInTimeOrderAndTellThePush) {
  Bench bench({});
  const Eigen::Isometry3d start = Bench::Tip(Vec(0.3, 0, 0.18));
  EXPECT_NEAR(bench.Move(start, Vec(0, 0, -0.052), 0.02), 0.002, 1e-9);
  ASSERT_EQ(bench.edges_.size(), 3u);
  for (const Edge& edge : bench.edges_) {
    EXPECT_TRUE(edge.pressed);
    EXPECT_GE(edge.known_s, edge.at_s);
  }
  bench.Move(bench.ended_at_, Vec(0, 0, 0.052), 0.1);
  ASSERT_EQ(bench.edges_.size(), 6u);
  for (int k = 3; k < 6; ++k) {
    EXPECT_FALSE(bench.edges_[k].pressed);
    EXPECT_GT(bench.edges_[k].at_s, bench.edges_[0].at_s);
  }
}

TEST(Fingers, ReportNothingWhenStoppedBeforeAContactOrBesideTheObject) {
  Bench bench({"return_hysteresis.fraction=0.5"}, 5000);
  const Eigen::Isometry3d start = Bench::Tip(Vec(0.3, 0, 0.18));
  bench.Move(start, Vec(0, 0, -0.08), 0.02, 0.049);
  EXPECT_EQ(bench.edges_.size(), 0u);
  EXPECT_EQ(bench.fingers_->touches(), 0u);
  const TouchTruth late = bench.Touch(), fresh = Bench({"return_hysteresis.fraction=0.5"}, 5000).Touch();
  // An approach in the air uses up neither chance nor memory.
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(late.reported_s[i] - late.contact_s[i], fresh.reported_s[i] - fresh.contact_s[i], 1e-9);
  bench.Touch(0.6);
  EXPECT_EQ(bench.fingers_->touches(), 1u);
}

TEST(Fingers, FeelHiddenEffectsAsTheCatalogueSays) {
  // Ball tips on a plane: later by r (1 / cos - 1).
  const double tilt = 20 * M_PI / 180;
  const TouchTruth point = Bench({}).Touch(0.3, tilt),
                   ball = Bench({"tip_radius.radius_mm=4"}).Touch(0.3, tilt);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(point.contact_s[i] - ball.contact_s[i], 0.004 * (1 / std::cos(tilt) - 1) / 0.02, 1e-8);

  const TouchTruth late = Bench({"channel_latency.latency_us=3000,-1000,-2000"}).Touch();
  EXPECT_NEAR(late.reported_s[0] - late.contact_s[0], 0.003, 1e-9);
  EXPECT_NEAR(late.reported_s[2] - late.contact_s[2], -0.002, 1e-9);

  // Times since the approach began are multiplied.
  const TouchTruth skewed = Bench({"clock_skew.relative=0.01"}).Touch();
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(skewed.reported_s[i], 1.01 * skewed.contact_s[i], 1e-9);

  const TouchTruth polled = Bench({"poll_interval.interval_us=10000"}).Touch(0.3, 0.1);
  const double ticks = (polled.reported_s[0] - polled.reported_s[2]) / 0.01;
  EXPECT_NEAR(ticks, std::round(ticks), 1e-6);
  EXPECT_GE(polled.reported_s[0], polled.contact_s[0]);
}

TEST(Fingers, RememberHowFarTheyWerePressedOnlyAsFarAsTheArmWent) {
  Bench bench({"return_hysteresis.fraction=0.5"});
  const double tilt = 10 * M_PI / 180;
  const TouchTruth first = bench.Touch(0.3, tilt), second = bench.Touch(0.3, tilt);
  const double last_s = std::max(first.contact_s[0], first.contact_s[2]);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(second.reported_s[i] - second.contact_s[i], -0.5 * (last_s - first.contact_s[i]), 1e-7) << i;
  // Stopped after the first finger alone: it was pressed by nothing more.
  const double first_m = *std::min_element(first.travel_m.begin(), first.travel_m.end());
  bench.Touch(0.3, tilt, first_m + 0.0001);
  const TouchTruth after = bench.Touch(0.3, tilt);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(after.reported_s[i], after.contact_s[i], 1e-7) << i;
}

TEST(Fingers, ScatterWithTheSigmaThatWasAskedFor) {
  Bench bench({}, 5000);
  double squares = 0, sum = 0;
  constexpr int kTouches = 400;
  for (int k = 0; k < kTouches; ++k) {
    const TouchTruth truth = bench.Touch();
    for (int i = 0; i < 3; ++i) {
      const double noise = truth.reported_s[i] - truth.contact_s[i];
      sum += noise, squares += noise * noise;
    }
  }
  const double n = 3 * kTouches;
  EXPECT_NEAR(sum / n, 0, 4 * 0.005 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.005, 4 * 0.005 / std::sqrt(2 * n));
  // The edges of a touch were handed over in the order of their times, never before they were decided.
  double last_s = 0;
  std::vector<Edge> pressed;
  for (const Edge& edge : bench.edges_)
    if (edge.pressed) pressed.push_back(edge);
  std::stable_sort(pressed.begin(), pressed.end(),
                   [](const Edge& a, const Edge& b) { return a.known_s < b.known_s; });
  for (const Edge& edge : pressed) {
    EXPECT_GE(edge.at_s, last_s);
    last_s = edge.at_s;
  }
}

TEST(Fingers, SayNothingWhenMissingOrLost) {
  Bench bench({});
  bench.faults_.Set("missing_finger", 1);
  const TouchTruth truth = bench.Touch();
  EXPECT_TRUE(std::isnan(truth.reported_s[1]));
  EXPECT_FALSE(std::isnan(truth.contact_s[1]));
  EXPECT_FALSE(std::isnan(truth.reported_s[0]));
  EXPECT_EQ(bench.edges_.size(), 4u);

  Bench lost({"missed_contact.probability=0.3"});
  int missing = 0;
  for (int k = 0; k < 200; ++k)
    for (const double reported_s : lost.Touch().reported_s) missing += std::isnan(reported_s);
  EXPECT_NEAR(missing / 600.0, 0.3, 4 * std::sqrt(0.3 * 0.7 / 600));
}

TEST(Fingers, KnowHowTheObjectLies) {
  Bench bench({});
  ASSERT_EQ(bench.fingers_->Mount("box", "+x"), "");
  // Standing on its end, as high above the fixture as before: the plate is at 0.07, the upper face at 0.22.
  const Eigen::Isometry3d start = Bench::Tip(Vec(0.3, 0, 0.25));
  bench.Move(start, Vec(0, 0, -0.05), 0.02);
  const TouchTruth truth = bench.fingers_->Touches().back();
  EXPECT_NEAR(truth.travel_m[1], 0.03, 1e-9);
  EXPECT_NEAR((truth.approach - Vec(-1, 0, 0)).norm(), 0, 1e-9);
  // The fingers still stand on it.
  EXPECT_NE(bench.fingers_->Mount("box", "+z"), "");
  bench.Move(bench.ended_at_, Vec(0, 0, 0.05), 0.1);
  EXPECT_EQ(bench.fingers_->Mount("box", "+z"), "");
  EXPECT_NE(bench.fingers_->Mount("sphere", "+z"), "");
  EXPECT_NE(bench.fingers_->Mount("box", "up"), "");
  EXPECT_EQ(bench.fingers_->object(), "box");
}

}  // namespace
}  // namespace touchstone::rig
