#include "tests/hidden_effects/generator/causes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/hidden_effects/generator/rig.h"

namespace touchstone::hidden {
namespace {

using Vec = Eigen::Vector3d;

constexpr double kRadian = M_PI / 180;

// A stream of its own for each of many.
std::mt19937_64 StreamOf(uint64_t seed, const char* purpose, uint64_t which) {
  return Stream(seed ^ (which + 1) * 0x9e3779b97f4a7c15, purpose);
}

}  // namespace

double TravelMm(const Cause& cause, const TouchState& state) {
  const double size = cause.size * (cause.fingers.empty() ? 1 : cause.fingers[state.finger]);
  const double time_s = state.session_time_s;
  const auto here = [&] { return state.object == static_cast<int>(cause.at[0]); };
  const auto in_its_round = [&] { return state.round == static_cast<int>(cause.at[0]); };
  switch (cause.kind) {
    case CauseKind::kSessionWave:
      return size * std::sin(2 * M_PI * time_s / cause.at[0] + cause.at[1]);
    case CauseKind::kWarmUp:
      return size * (1 - std::exp(-time_s / cause.at[0]));
    case CauseKind::kMidSession:
      return time_s >= cause.at[0] ? size : 0;
    case CauseKind::kIncidenceWave: {
      const double incidence = std::atan(state.tan_incidence);
      return incidence >= cause.at[1] * kRadian ? size * std::sin(cause.at[0] * incidence) : 0;
    }
    case CauseKind::kFingerCoupling:
      return size * state.neighbours_mm;
    case CauseKind::kSlipOnOneObject:
      return here() ? size * state.tan_incidence : 0;
    case CauseKind::kPushOnOneObject:
      return here() && !state.first ? size : 0;
    case CauseKind::kSlipInOneRound:
      return in_its_round() ? size * state.tan_incidence : 0;
    case CauseKind::kPushInOneRound:
      return in_its_round() && !state.first ? size : 0;
    case CauseKind::kRemounted:
    case CauseKind::kPoseError:
    case CauseKind::kNoiseWithMemory:
    case CauseKind::kRandomWalk:
      return 0;
  }
  return 0;
}

Placement PlacementOf(const Cause& remounted, uint64_t seed, int object, int round) {
  auto random = StreamOf(seed, "put", 1000 * object + round);
  std::normal_distribution<double> normal;
  Placement placement;
  for (double& axis : placement.moved_mm) axis = remounted.size * normal(random);
  // The turn keeps its proportion to the shift, so that the size alone makes the cause weaker.
  placement.turned =
      Eigen::AngleAxisd(remounted.size * remounted.at[0] * kRadian * normal(random), Vec::UnitZ())
          .toRotationMatrix();
  return placement;
}

Eigen::Matrix3d TiltOf(const Cause& pose_error, uint64_t seed, int pose, const Vec& approach,
                       const Vec& lateral) {
  auto random = StreamOf(seed, "askew", pose);
  std::normal_distribution<double> normal;
  const double along = pose_error.size * kRadian * normal(random);
  const double across = pose_error.size * kRadian * normal(random);
  const Vec turn = along * approach.cross(lateral) + across * lateral;
  return turn.norm() > 0 ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix()
                         : Eigen::Matrix3d::Identity();
}

std::vector<double> AddedNoiseUs(const Cause& cause, uint64_t seed, const std::vector<double>& session_time_s,
                                 int fingers) {
  std::vector<double> out(session_time_s.size() * fingers, 0);
  const bool walk = cause.kind == CauseKind::kRandomWalk;
  if (!walk && cause.kind != CauseKind::kNoiseWithMemory) return out;
  auto random = Stream(seed, "memory");
  std::normal_distribution<double> normal;
  std::vector<double> state(fingers);
  if (!walk)
    for (double& value : state) value = normal(random);
  for (size_t k = 0; k < session_time_s.size(); ++k) {
    const double pause_s = k == 0 ? 0 : session_time_s[k] - session_time_s[k - 1];
    const double kept = walk ? 1 : std::exp(-pause_s / cause.at[0]);
    const double fresh = walk ? std::sqrt(pause_s / 3600) : std::sqrt(1 - kept * kept);
    for (int i = 0; i < fingers; ++i) {
      state[i] = kept * state[i] + fresh * normal(random);
      out[k * fingers + i] = cause.size * state[i];
    }
  }
  return out;
}

std::string InWords(const Cause& cause) {
  static const char* const kNames[] = {"session wave",       "warm-up",
                                       "mid-session offset", "incidence wave",
                                       "finger coupling",    "slip on one object",
                                       "push on one object", "remounted each round",
                                       "error of each pose", "noise with memory",
                                       "random walk",        "slip in one round",
                                       "push in one round"};
  char text[32];
  std::string words = kNames[static_cast<int>(cause.kind)];
  const auto add = [&](double value) {
    snprintf(text, sizeof text, " %.4g", value);
    words += text;
  };
  add(cause.size);
  for (const double value : cause.at) add(value);
  if (!cause.fingers.empty()) words += " by finger";
  for (const double value : cause.fingers) add(value);
  return words;
}

}  // namespace touchstone::hidden
