// Speed along a path as pieces of constant acceleration: exact at every time since the motion began.
#pragma once

#include <vector>

namespace touchstone::rig {

class SpeedProfile {
 public:
  // Trapezoid from rest over `length` at most `speed`, with `acceleration` both ways. All above 0.
  // `first_speed`: it already moves so fast.
  SpeedProfile(double start_s, double length, double speed, double acceleration, double first_speed = 0);

  double LengthAt(double time_s) const;  // 0 before the start
  double SpeedAt(double time_s) const;
  double AccelerationAt(double time_s) const;
  double EndS() const {
    return end_s_;
  }  // when it comes to rest for good; infinite while it is held at speed 0
  double EndLength() const;
  // When it will have come so far; infinite if never.
  double TimeOf(double length) const;

  // From now on: another cruising speed (0: comes to rest and stays there until the next change).
  void Cruise(double now_s, double speed, double acceleration);
  // From now on: comes to rest as soon as `deceleration` permits.
  void Stop(double now_s, double deceleration);
  // Stands still at once, as a frozen controller does; Cruise() goes on.
  void Hold(double now_s);

 private:
  struct Piece {
    double start_s, length, speed, acceleration;
  };
  const Piece& At(double time_s) const;
  void Cut(double now_s);  // drops what was planned for later
  void Add(double duration_s, double acceleration);
  void Plan(double now_s, double from, double first_speed, double speed, double acceleration);

  double whole_length_;
  double end_s_ = 0;
  double planned_until_s_ = 0;
  std::vector<Piece> pieces_;
};

}  // namespace touchstone::rig
