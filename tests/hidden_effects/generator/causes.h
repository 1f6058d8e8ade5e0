// Causes that no entry of the catalogue describes as it stands: what drifts, begins or levels off with time, acts on
// one object only, or belongs to one pose or one round. Written from their definitions alone.
#pragma once

#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace touchstone::hidden {

enum class CauseKind {
  kSessionWave,     // mm, per finger; at: period in s, phase in rad
  kWarmUp,          // mm, per finger; at: time constant in s
  kMidSession,      // mm, per finger; at: when it begins, s
  kIncidenceWave,   // mm; at: rad per rad of incidence, from so many degrees on
  kFingerCoupling,  // mm for an inner finger per mm that its left neighbour travels farther than its right one
  kSlipOnOneObject,  // mm per tan(incidence); at: the object
  kPushOnOneObject,  // mm for every finger but the first; at: the object
  kRemounted,        // mm along each axis, anew for every object and round; at: deg about z
  kPoseError,        // deg of tilt along and across the row, fixed for each pose
  kNoiseWithMemory,  // us, per finger, stationary; at: correlation time in s
  kRandomWalk,       // us per square root of an hour, per finger
  kSlipInOneRound,   // mm per tan(incidence); at: the round
  kPushInOneRound,   // mm for every finger but the first; at: the round
};

struct Cause {
  CauseKind kind = CauseKind::kSessionWave;
  double size = 0;              // in the unit of its kind; what follows stays as it is when the size changes
  std::vector<double> at;       // further numbers of its kind
  std::vector<double> fingers;  // share of the size for each finger; empty: the whole for all
};

// What a cause may depend on, for one finger of one touch.
struct TouchState {
  int object = 0, finger = 0;
  double session_time_s = 0;
  double tan_incidence = 0;
  bool first = false;        // touches before all others
  double neighbours_mm = 0;  // travel of the left neighbour less that of the right one; 0 without both
  int round = 0;
};

// Travel that the cause adds, mm; 0 for causes of the pose and of the noise.
double TravelMm(const Cause& cause, const TouchState& state);

// Where an object stands: v -> R v + moved_mm.
struct Placement {
  Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
  Eigen::Vector3d moved_mm = Eigen::Vector3d::Zero();
};
Placement PlacementOf(const Cause& remounted, uint64_t seed, int object, int round);

// By how much the tool stands rotated at a pose, as a rotation about the target.
Eigen::Matrix3d TiltOf(const Cause& pose_error, uint64_t seed, int pose, const Eigen::Vector3d& approach,
                       const Eigen::Vector3d& lateral);

// What is added to the times, us, [touch * fingers + finger], for touches at these times of the session; zeros for
// causes that are no noise. Proportional to the size.
std::vector<double> AddedNoiseUs(const Cause& cause, uint64_t seed, const std::vector<double>& session_time_s,
                                 int fingers);

// "session wave 0.21 (1200 0.3)".
std::string InWords(const Cause& cause);

}  // namespace touchstone::hidden
