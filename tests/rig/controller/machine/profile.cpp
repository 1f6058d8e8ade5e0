#include "tests/rig/controller/machine/profile.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/rig/controller/never.h"
namespace touchstone::rig {
namespace {}  // namespace

SpeedProfile::SpeedProfile(double start_s, double length, double speed, double acceleration,
                           double first_speed)
    : whole_length_(length) {
  Plan(start_s, 0, first_speed, speed, acceleration);
}

// Pieces from here to rest at the whole length: first to the cruising speed, then level, then down to rest.
void SpeedProfile::Plan(double now_s, double from, double first_speed, double speed, double acceleration) {
  const double left = whole_length_ - from;
  planned_until_s_ = now_s;
  pieces_.push_back({now_s, from, first_speed, 0});
  if (left <= 0) {
    pieces_.back().speed = 0;
    end_s_ = now_s;
    return;
  }
  if (speed <= 0) {
    if (first_speed > 0) Add(first_speed / acceleration, -acceleration);
    pieces_.push_back({planned_until_s_, LengthAt(planned_until_s_), 0, 0});
    end_s_ = kNever;
    return;
  }
  // Too fast to come to rest in what is left: brakes harder than commanded, but never goes beyond the end.
  if (first_speed * first_speed > 2 * acceleration * left) {
    const double braking = first_speed * first_speed / (2 * left);
    Add(first_speed / braking, -braking);
  } else {
    // The highest speed from which it can still come to rest at the end.
    const double highest = std::sqrt(acceleration * left + first_speed * first_speed / 2);
    const double cruise = first_speed > speed ? speed : std::min(speed, highest);
    const double change_s = std::abs(cruise - first_speed) / acceleration;
    if (change_s > 0) Add(change_s, cruise > first_speed ? acceleration : -acceleration);
    const double changing = change_s * (cruise + first_speed) / 2;
    const double level = left - changing - cruise * cruise / (2 * acceleration);
    if (level > 0) Add(level / cruise, 0);
    Add(cruise / acceleration, -acceleration);
  }
  end_s_ = planned_until_s_;
  pieces_.push_back({end_s_, whole_length_, 0, 0});
}

// Appends a piece; the piece before it says where and how fast it begins.
void SpeedProfile::Add(double duration_s, double acceleration) {
  const Piece last = pieces_.back();
  const double dt = planned_until_s_ - last.start_s;
  const double speed = last.speed + last.acceleration * dt;
  const double length = last.length + (last.speed + last.acceleration * dt / 2) * dt;
  pieces_.push_back({planned_until_s_, length, std::max(speed, 0.0), acceleration});
  planned_until_s_ += duration_s;
}

const SpeedProfile::Piece& SpeedProfile::At(double time_s) const {
  size_t i = pieces_.size() - 1;
  while (i > 0 && pieces_[i].start_s > time_s) --i;
  return pieces_[i];
}

double SpeedProfile::LengthAt(double time_s) const {
  const Piece& piece = At(time_s);
  const double dt = std::max(time_s - piece.start_s, 0.0);
  return std::clamp(piece.length + (piece.speed + piece.acceleration * dt / 2) * dt, 0.0, whole_length_);
}

double SpeedProfile::SpeedAt(double time_s) const {
  const Piece& piece = At(time_s);
  if (time_s < piece.start_s) return 0;
  return std::max(piece.speed + piece.acceleration * (time_s - piece.start_s), 0.0);
}

double SpeedProfile::AccelerationAt(double time_s) const {
  const Piece& piece = At(time_s);
  return time_s < piece.start_s ? 0 : piece.acceleration;
}

double SpeedProfile::EndLength() const {
  return pieces_.back().length;
}

double SpeedProfile::TimeOf(double length) const {
  for (size_t i = 0; i < pieces_.size(); ++i) {
    const Piece& piece = pieces_[i];
    const double next = i + 1 < pieces_.size() ? pieces_[i + 1].length : piece.length;
    if (length > next && i + 1 < pieces_.size()) continue;
    if (length <= piece.length) return piece.start_s;
    if (length > next) return kNever;
    // length = l + v t + a t^2 / 2, the root on the way forward, written so that a = 0 is no special case.
    const double way = length - piece.length;
    const double root = std::sqrt(std::max(piece.speed * piece.speed + 2 * piece.acceleration * way, 0.0));
    const double sum = piece.speed + root;
    return sum > 0 ? piece.start_s + 2 * way / sum : kNever;
  }
  return kNever;
}

void SpeedProfile::Cut(double now_s) {
  while (pieces_.size() > 1 && pieces_.back().start_s >= now_s) pieces_.pop_back();
}

void SpeedProfile::Cruise(double now_s, double speed, double acceleration) {
  const double length = LengthAt(now_s), current = SpeedAt(now_s);
  Cut(now_s);
  Plan(now_s, length, current, speed, acceleration);
}

void SpeedProfile::Stop(double now_s, double deceleration) {
  const double length = LengthAt(now_s), speed = SpeedAt(now_s);
  const double way = std::min(speed * speed / (2 * deceleration), whole_length_ - length);
  Cut(now_s);
  whole_length_ = length + way;
  Plan(now_s, length, speed, std::max(speed, 1e-12), deceleration);
}

void SpeedProfile::Hold(double now_s) {
  const double length = LengthAt(now_s);
  Cut(now_s);
  pieces_.push_back({now_s, length, 0, 0});
  planned_until_s_ = now_s;
  end_s_ = kNever;
}

}  // namespace touchstone::rig
