#include "tests/hidden_effects/score/arms/outside_strengths.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "tests/hidden_effects/generator/rig.h"

namespace touchstone::hidden {
namespace {

using Random = std::mt19937_64;

constexpr double kSecondsPerTouch = 9;  // of the generator's sessions
constexpr double kBoundMm = 5;          // of lengths, push and slip in the catalogue

double Uniform(double low, double high, Random& random) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

template <typename T>
T OneOf(const std::vector<T>& from, Random& random) {
  return from[random() % from.size()];
}

// One finger, or the outer ones against each other.
std::vector<double> FingerShares(int fingers, bool may_be_two, Random& random) {
  std::vector<double> shares(fingers, 0);
  const double sign = random() % 2 ? 1 : -1;
  if (may_be_two && fingers > 1 && random() % 2)
    shares.front() = sign, shares.back() = -sign;
  else
    shares[random() % fingers] = sign;
  return shares;
}

int TouchesOf(const Scenario& scenario) {
  return static_cast<int>(scenario.objects.size()) * scenario.poses * scenario.rounds;
}

// With a size from which the signal is measured.
Cause Shape(CauseKind kind, const Scenario& scenario, Random& random) {
  const double session_s = TouchesOf(scenario) * kSecondsPerTouch;
  const double object = random() % scenario.objects.size();
  switch (kind) {
    case CauseKind::kSessionWave:
      return {kind,
              0.2,
              {Uniform(session_s / 20, session_s / 4, random), Uniform(0, 2 * M_PI, random)},
              FingerShares(scenario.fingers, true, random)};
    case CauseKind::kWarmUp:
      return {kind,
              0.3,
              {Uniform(session_s / 20, session_s / 6, random)},
              FingerShares(scenario.fingers, false, random)};
    case CauseKind::kMidSession:
      return {
          kind, 0.2, {Uniform(0.25, 0.75, random) * session_s}, FingerShares(scenario.fingers, true, random)};
    case CauseKind::kIncidenceWave:
      return {kind, 0.2, {Uniform(25, 50, random), Uniform(0, 20, random)}, {}};
    case CauseKind::kFingerCoupling:
      return {kind, OneOf<double>({-0.05, 0.05}, random), {}, {}};
    case CauseKind::kSlipOnOneObject:
      return {kind, 0.5, {object}, {}};
    case CauseKind::kPushOnOneObject:
      return {kind, 0.4, {object}, {}};
    case CauseKind::kSlipInOneRound:
      return {kind, 0.5, {static_cast<double>(random() % scenario.rounds)}, {}};
    case CauseKind::kPushInOneRound:
      return {kind, 0.4, {static_cast<double>(random() % scenario.rounds)}, {}};
    case CauseKind::kRemounted:
      return {kind, 0.3, {Uniform(0.5, 1.5, random)}, {}};
    case CauseKind::kPoseError:
      return {kind, 0.1, {}, {}};
    case CauseKind::kNoiseWithMemory:
      return {kind, 7000, {Uniform(50, 500, random)}, {}};
    case CauseKind::kRandomWalk:
      return {kind, 7000, {}, {}};
  }
  return {};
}

// Of these a constant and a steady drift of each finger are catalogued; what counts is the rest.
bool DependsOnTimeAlone(CauseKind kind) {
  return kind == CauseKind::kSessionWave || kind == CauseKind::kWarmUp || kind == CauseKind::kMidSession ||
         kind == CauseKind::kRandomWalk;
}

// The plain times and, for each finger, the straight line in session time that comes closest to what was changed. All
// fingers of all touches report.
std::vector<double> StraightLines(const Set& changed, const Set& plain) {
  std::vector<double> out = plain.reported_us;
  const int fingers = plain.truth.fingers, touches = plain.touches;
  double mean_s = 0, spread_s2 = 0;
  for (const double time_s : plain.session_time_s) mean_s += time_s / touches;
  for (const double time_s : plain.session_time_s) spread_s2 += (time_s - mean_s) * (time_s - mean_s);
  for (int i = 0; i < fingers; ++i) {
    double level_us = 0, slope_us_s = 0;
    for (int k = 0; k < touches; ++k) {
      const double change_us = changed.reported_us[k * fingers + i] - plain.reported_us[k * fingers + i];
      level_us += change_us / touches;
      slope_us_s += change_us * (plain.session_time_s[k] - mean_s) / spread_s2;
    }
    for (int k = 0; k < touches; ++k)
      out[k * fingers + i] += level_us + slope_us_s * (plain.session_time_s[k] - mean_s);
  }
  return out;
}

}  // namespace

double SignalOf(const Cause& cause, const Scenario& scenario, uint64_t seed) {
  Scenario with = scenario;
  with.causes.push_back(cause);
  const Set changed = Generate(with, seed), plain = Generate(scenario, seed);
  const std::vector<double> straight_us =
      DependsOnTimeAlone(cause.kind) ? StraightLines(changed, plain) : plain.reported_us;
  return SignalInStandardErrors(changed.reported_us, straight_us, scenario.fingers, scenario.sigma_us);
}

Cause DrawnCause(CauseKind kind, const Scenario& scenario, uint64_t seed, Strength strength) {
  auto random = Stream(seed, "cause");
  Cause cause = Shape(kind, scenario, random);
  const double per_sigma = std::sqrt(TouchesOf(scenario) * (scenario.fingers - 1.0));
  const double part = kind == CauseKind::kRemounted || kind == CauseKind::kPoseError ? 0.4 : 1;
  double wanted = Uniform(10, 15, random);
  if (strength == Strength::kRealistic) wanted = part * Uniform(0.8, 1.5, random) * per_sigma;
  if (strength == Strength::kStrong) wanted = part * Uniform(3, 6, random) * per_sigma;
  // Nearly proportional; twice for what turns the touch.
  for (int step = 0; step < 2; ++step) cause.size *= wanted / SignalOf(cause, scenario, seed);
  return cause;
}

Hidden BeyondBound(const Scenario& scenario, uint64_t seed, Strength strength) {
  auto random = Stream(seed, "beyond");
  double times = Uniform(1.12, 1.2, random);
  if (strength == Strength::kRealistic) times = Uniform(1.5, 2, random);
  if (strength == Strength::kStrong) times = Uniform(2.5, 4, random);
  static const std::vector<std::string> kBounded = {"object_push", "oblique_slip", "finger_length"};
  const std::string& effect = kBounded[random() % kBounded.size()];
  const double value = times * kBoundMm;
  if (ValueCount(effect, scenario.fingers) == 1) return {effect, {value}};
  // The middle finger against the others, beyond the bound alone.
  std::vector<double> values(scenario.fingers, -value / (scenario.fingers - 1));
  values[scenario.fingers / 2] = value;
  return {effect, values};
}

DataError DrawnDataError(DataErrorKind kind, const Scenario& scenario, uint64_t seed, Strength strength) {
  auto random = Stream(seed, "blunder");
  DataError data_error{kind, 0, {}};
  switch (kind) {
    case DataErrorKind::kLateralReversed:
    case DataErrorKind::kApproachReversed:
      break;
    case DataErrorKind::kColumnSorted:
      data_error.which = {static_cast<int>(random() % scenario.fingers)};
      break;
    case DataErrorKind::kFingersPermuted: {
      std::vector<int> order(scenario.fingers);
      for (int i = 0; i < scenario.fingers; ++i) order[i] = i;
      while (std::is_sorted(order.begin(), order.end())) std::shuffle(order.begin(), order.end(), random);
      data_error.which = order;
      break;
    }
    case DataErrorKind::kObjectsSwapped:
    case DataErrorKind::kWrongObject: {
      const int objects = scenario.objects.size(), one = random() % objects;
      data_error.which = {one, static_cast<int>((one + 1 + random() % (objects - 1)) % objects)};
      break;
    }
    case DataErrorKind::kTimeUnits:
      data_error.number = OneOf<double>({0.1, 10, 0.001, 1000}, random);
      break;
    case DataErrorKind::kLengthUnits:
      data_error.number = OneOf<double>({0.1, 0.001, 1 / 25.4}, random);
      break;
    case DataErrorKind::kSpeedFactor:
      data_error.number = OneOf<double>({2, 2, 0.5, 10, 60}, random);
      break;
    case DataErrorKind::kObjectLower:
      data_error.number = Uniform(15, 30, random);
      break;
    case DataErrorKind::kFrameTurned:
      // The objects look alike from four sides about z.
      data_error.number = OneOf<double>({90, 270}, random);
      break;
    case DataErrorKind::kRowsShifted:
      data_error.which = {OneOf<int>({-1, 1}, random)};
      break;
    case DataErrorKind::kCopies:
      data_error.number = strength == Strength::kWeak ? 0.1 : strength == Strength::kRealistic ? 0.5 : 1;
      data_error.which = {strength == Strength::kStrong ? 3 : 1};
      break;
  }
  return data_error;
}

}  // namespace touchstone::hidden
