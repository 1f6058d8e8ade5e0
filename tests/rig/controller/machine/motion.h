// One motion of the arm: a straight line of the tip, or a line in joint space. Where it is at
// any time, exactly.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/rig/controller/machine/profile.h"
#include "tests/rig/controller/script/kinematics.h"

namespace touchstone::rig {

class Path {
 public:
  virtual ~Path() = default;
  virtual Joints JointsAt(double length) const = 0;
  // Velocity of the joints per unit of length.
  virtual Joints Direction(double length) const = 0;
  virtual double Length() const = 0;  // m along a straight line, rad of the leading joint otherwise
  // Where the arm cannot go on at a speed of at most `speed(length)`, and why. None: all of it can be driven.
  struct Obstacle {
    double length;
    std::string why;
  };
  virtual std::optional<Obstacle> FirstObstacle(double speed, double acceleration) const = 0;
};

// A straight line of the tip, position and rotation together. `v` is the tip's speed, however much the tool
// turns on the way; a line that only turns is measured by its turn, at kMetresPerRadian.
inline constexpr double kMetresPerRadian = 0.25;
inline constexpr double kTurnOnly = 1e-4;  // m; a shorter line only turns

// Which way round the tool turns on a line: the shorter one, or the one that begins in the other direction.
enum class LineTurn { kShorter, kLonger };
// From this turn on a line counts as half a turn: which way is the shorter one depends on rounding and on where exactly
// the arm stands, and a controller may take either (UR documents none: script manual, movel).
inline constexpr double kHalfTurnFromRad = 3.0892;  // 177 deg

class LinePath : public Path {
 public:
  LinePath(const ArmGeometry& arm, const Joints& from, const Eigen::Isometry3d& flange_from_tip,
           const Eigen::Isometry3d& base_from_tip_end, LineTurn turn = LineTurn::kShorter);
  Joints JointsAt(double length) const override;
  Joints Direction(double length) const override;
  double Length() const override { return length_; }
  std::optional<Obstacle> FirstObstacle(double speed, double acceleration) const override;

  Eigen::Isometry3d TipAt(double length) const;
  double TurnRad() const { return turn_.norm(); }
  const Eigen::Isometry3d& from() const { return from_; }
  const Eigen::Isometry3d& to() const { return to_; }
  // Metres of the tip per unit of length: 1, less if the turn is what counts, 0 for a turn on the spot.
  double MetresPerLength() const { return length_ > 0 ? metres_ / length_ : 0; }

 private:
  ArmGeometry arm_;
  Eigen::Isometry3d tip_from_flange_, from_, to_;
  Eigen::Vector3d turn_;  // rotation vector from `from_` to `to_`, base frame
  double metres_ = 0, length_ = 0;
  double knot_spacing_ = 0;
  std::vector<Joints> knots_;  // as far as the arm reaches
};

class JointPath : public Path {
 public:
  JointPath(const ArmGeometry& arm, const Joints& from, const Joints& to);
  Joints JointsAt(double length) const override;
  Joints Direction(double length) const override;
  double Length() const override { return length_; }
  std::optional<Obstacle> FirstObstacle(double speed, double acceleration) const override;

 private:
  ArmGeometry arm_;
  Joints from_, to_;
  double length_;
};

}  // namespace touchstone::rig
