#include "tests/rig/controller/machine/motion.h"

#include <algorithm>
#include <cmath>

namespace touchstone::rig {
namespace {

constexpr double kKnotEvery = 0.005;  // of length, m
constexpr int kMaxKnots = 4000;

std::string JointName(int i) {
  return "joint " + std::to_string(i);
}

std::optional<std::string> LimitBroken(const ArmGeometry& arm, const Joints& joints) {
  for (int i = 0; i < 6; ++i)
    if (std::abs(joints[i]) > arm.max_angle_rad[i] + 1e-9)
      return JointName(i) + " exceeds its position limit";
  return std::nullopt;
}

std::optional<std::string> TooFast(const ArmGeometry& arm, const Joints& speed_rad_s) {
  for (int i = 0; i < 6; ++i)
    if (std::abs(speed_rad_s[i]) > arm.max_speed_rad_s[i] * (1 + 1e-6))
      return JointName(i) + " exceeds its speed limit";
  return std::nullopt;
}

}  // namespace

LinePath::LinePath(const ArmGeometry& arm, const Joints& from, const Eigen::Isometry3d& flange_from_tip,
                   const Eigen::Isometry3d& base_from_tip_end, LineTurn turn)
    : arm_(arm),
      tip_from_flange_(flange_from_tip.inverse()),
      from_(BaseFromFlange(arm, from) * flange_from_tip),
      to_(base_from_tip_end),
      turn_(RotationVector(to_.linear() * from_.linear().transpose())) {
  if (turn == LineTurn::kLonger && turn_.norm() > 0) turn_ -= 2 * M_PI * turn_.normalized();
  metres_ = (to_.translation() - from_.translation()).norm();
  const double turned = kMetresPerRadian * turn_.norm();
  length_ = metres_ > kTurnOnly ? metres_ : turned;
  if (length_ < 1e-9) length_ = metres_ = 0;
  const int count =
      std::clamp(static_cast<int>(std::ceil(std::max(metres_, turned) / kKnotEvery)), 1, kMaxKnots);
  knot_spacing_ = length_ / count;
  knots_ = {from};
  for (int i = 1; i <= count && length_ > 0; ++i) {
    const std::optional<Joints> next =
        FollowTo(arm_, TipAt(i * knot_spacing_) * tip_from_flange_, knots_.back());
    // A jump to another branch is no way for an arm to go.
    if (!next || (*next - knots_.back()).lpNorm<Eigen::Infinity>() > 1) break;
    knots_.push_back(*next);
  }
}

Eigen::Isometry3d LinePath::TipAt(double length) const {
  if (length <= 0 || length_ <= 0) return from_;
  if (length >= length_) return to_;
  const double part = length / length_;
  Eigen::Isometry3d tip = from_;
  tip.translation() += part * (to_.translation() - from_.translation());
  const double angle = turn_.norm();
  if (angle > 0)
    tip.linear() = Eigen::AngleAxisd(part * angle, turn_ / angle).toRotationMatrix() * from_.linear();
  return tip;
}

Joints LinePath::JointsAt(double length) const {
  if (length_ <= 0 || knots_.size() < 2) return knots_[0];
  const double at = std::clamp(length / knot_spacing_, 0.0, static_cast<double>(knots_.size() - 1));
  const size_t i = std::min(static_cast<size_t>(at), knots_.size() - 2);
  const Joints guess = knots_[i] + (at - i) * (knots_[i + 1] - knots_[i]);
  return FollowTo(arm_, TipAt(at * knot_spacing_) * tip_from_flange_, guess).value_or(guess);
}

Joints LinePath::Direction(double length) const {
  if (length_ <= 0 || knots_.size() < 2) return Joints::Zero();
  const double step = std::min(1e-5, knot_spacing_ / 4);
  const double most = (knots_.size() - 1) * knot_spacing_;
  const double middle = std::clamp(length, step, most - step);
  return (JointsAt(middle + step) - JointsAt(middle - step)) / (2 * step);
}

std::optional<Path::Obstacle> LinePath::FirstObstacle(double speed, double acceleration) const {
  if (length_ <= 0) return std::nullopt;
  for (size_t i = 1; i < knots_.size(); ++i) {
    const double begin = (i - 1) * knot_spacing_, end = i * knot_spacing_;
    if (auto why = LimitBroken(arm_, knots_[i])) return Obstacle{begin, *why};
    // The fastest that a trapezoid can be within these bounds.
    const double fastest =
        std::min({speed, std::sqrt(2 * acceleration * end), std::sqrt(2 * acceleration * (length_ - begin))});
    if (auto why = TooFast(arm_, fastest / knot_spacing_ * (knots_[i] - knots_[i - 1])))
      return Obstacle{begin, *why};
  }
  const double reached = (knots_.size() - 1) * knot_spacing_;
  if (reached < length_ - knot_spacing_ / 2)
    return Obstacle{reached, "the pose is out of reach or near a singularity"};
  return std::nullopt;
}

JointPath::JointPath(const ArmGeometry& arm, const Joints& from, const Joints& to)
    : arm_(arm), from_(from), to_(to), length_((to - from).lpNorm<Eigen::Infinity>()) {}

Joints JointPath::JointsAt(double length) const {
  if (length_ <= 0 || length <= 0) return from_;
  if (length >= length_) return to_;
  return from_ + length / length_ * (to_ - from_);
}

Joints JointPath::Direction(double) const {
  return length_ > 0 ? Joints((to_ - from_) / length_) : Joints(Joints::Zero());
}

std::optional<Path::Obstacle> JointPath::FirstObstacle(double speed, double acceleration) const {
  if (length_ <= 0) return std::nullopt;
  if (auto why = LimitBroken(arm_, to_)) return Obstacle{0, *why};
  const double fastest = std::min(speed, std::sqrt(acceleration * length_));
  if (auto why = TooFast(arm_, fastest * Direction(0))) return Obstacle{0, *why};
  return std::nullopt;
}

}  // namespace touchstone::rig
