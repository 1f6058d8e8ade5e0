#include "tests/hidden_effects/score/arms/strengths.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/generator/unlisted.h"

namespace touchstone::hidden {
namespace {

using Random = std::mt19937_64;

constexpr double kMinRealistic = 25;
constexpr double kAsideMm = 0.3;
const double kMinCosine = std::cos(15 * M_PI / 180);  // between the normals of one face

double Between(double low, double high, Random& random) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

double EitherSign(double low, double high, Random& random) {
  const double size = Between(low, high, random);
  return Between(-1, 1, random) < 0 ? -size : size;
}

// One number per finger, sum 0; the middle one differs from the others, so that no tilt resembles it.
std::vector<double> FingerPattern(int fingers, double size, Random& random) {
  std::vector<double> out(fingers);
  double mean = 0;
  for (int i = 0; i < fingers; ++i) {
    out[i] = (i % 2 == 0 ? 1 : -1) * Between(0.4, 1, random) * size;
    mean += out[i] / fingers;
  }
  const double sign = Between(-1, 1, random) < 0 ? -1 : 1;
  for (double& value : out) value = sign * (value - mean);
  return out;
}

// A tenth of the distance to neutral is a tenth of the strength.
Hidden Scaled(Hidden hidden, double factor) {
  for (double& value : hidden.values)
    value = hidden.effect == "acceleration_ramp" ? value / factor : value * factor;
  return hidden;
}

double Signal(const Hidden& hidden, const Scenario& scenario, const Set& like,
              const std::vector<double>& without, uint64_t seed) {
  Scenario with = scenario;
  with.hidden.push_back(hidden);
  return SignalInStandardErrors(ExactTimesUs(with, like, seed), without, scenario.fingers, scenario.sigma_us);
}

Hidden Drawn(const std::string& effect, const Scenario& scenario, Random& random) {
  const int fingers = scenario.fingers;
  const auto one = [&](double low, double high) { return Hidden{effect, {Between(low, high, random)}}; };
  const auto either = [&](double low, double high) {
    return Hidden{effect, {EitherSign(low, high, random)}};
  };
  if (effect == "tool_yaw") return either(1, 4);
  if (effect == "tool_tilt") return either(0.2, 0.8);
  if (effect == "finger_spacing") return either(0.3, 1);
  if (effect == "finger_length") return {effect, FingerPattern(fingers, Between(0.1, 0.3, random), random)};
  if (effect == "gravity_sag") return one(0.3, 1);
  if (effect == "object_scale") return either(0.003, 0.01);
  if (effect == "tip_radius") return one(1, 3);
  if (effect == "surface_error") return {effect, {Between(0.06, 0.15, random), Between(15, 35, random)}};
  if (effect == "speed_error") return either(0.02, 0.05);
  // So slow that contacts fall into the ramp: v^2 / (2 a) from 0.6 to 1.2 standoffs.
  if (effect == "acceleration_ramp") {
    const double speed = scenario.speeds_mm_s[0];
    return {effect, {speed * speed / (2 * scenario.standoff_mm * Between(0.6, 1.2, random))}};
  }
  if (effect == "contact_slowdown") return one(0.03, 0.1);
  if (effect == "object_push") return one(0.15, 0.5);
  if (effect == "oblique_slip") return one(0.2, 0.6);
  if (effect == "channel_latency")
    return {effect, FingerPattern(fingers, Between(4000, 10'000, random), random)};
  if (effect == "thermal_drift") return {effect, FingerPattern(fingers, Between(0.1, 0.3, random), random)};
  if (effect == "return_hysteresis") return one(0.03, 0.1);
  if (effect == "clock_skew") return either(0.02, 0.04);
  if (effect == "poll_interval") return one(2.5 * scenario.sigma_us, 6 * scenario.sigma_us);
  if (effect == "incidence_noise") return one(1.5, 3);
  if (effect == "heavy_tail_noise") return one(2.5, 4);
  if (effect == "missed_contact") return one(0.03, 0.1);
  // object_pose: every object was put down anew.
  Hidden pose{effect, {}};
  for (size_t object = 0; object < scenario.objects.size(); ++object)
    for (int k = 0; k < 6; ++k) pose.values.push_back(EitherSign(0.2, 0.8, random));
  return pose;
}

// Whether every finger meets the same face when it moves aside.
bool IsAwayFromEdges(const Scenario& scenario, const Command& command) {
  const Solid& solid = *scenario.objects[command.object];
  const Eigen::Vector3d across = command.approach.cross(command.lateral);
  for (int i = 0; i < scenario.fingers; ++i) {
    const double x = (i - 0.5 * (scenario.fingers - 1)) * scenario.spacing_mm;
    const Eigen::Vector3d tip =
        command.target_mm - command.approach * scenario.standoff_mm + command.lateral * x;
    const Contact here = solid.FirstContact(tip, command.approach, 0);
    for (const Eigen::Vector3d& aside :
         {command.lateral, Eigen::Vector3d(-command.lateral), across, Eigen::Vector3d(-across)}) {
      const Contact there = solid.FirstContact(tip + kAsideMm * aside, command.approach, 0);
      if (!here.hit || !there.hit || here.outward.dot(there.outward) < kMinCosine) return false;
    }
  }
  return true;
}

}  // namespace

std::vector<double> TimesAwayFromEdges(const Set& set) {
  std::vector<double> out = set.exact_time_us;
  const int fingers = set.truth.fingers;
  std::map<int, bool> away;  // by pose
  for (int k = 0; k < set.touches; ++k) {
    const Command& command = set.commands[k];
    const auto [known, is_new] = away.try_emplace(command.pose, true);
    if (is_new) known->second = IsAwayFromEdges(set.truth, command);
    if (!known->second) std::fill_n(out.begin() + static_cast<size_t>(k) * fingers, fingers, NAN);
  }
  return out;
}

const std::vector<std::string>& EffectsOfExpectation() {
  static const auto* names = new std::vector<std::string>{
      "tool_yaw",          "tool_tilt",   "finger_spacing", "finger_length",   "gravity_sag",
      "object_scale",      "object_pose", "tip_radius",     "speed_error",     "acceleration_ramp",
      "contact_slowdown",  "object_push", "oblique_slip",   "channel_latency", "thermal_drift",
      "return_hysteresis", "clock_skew"};
  return *names;
}

const std::vector<std::string>& EffectsOfScatter() {
  static const auto* names =
      new std::vector<std::string>{"poll_interval", "incidence_noise", "heavy_tail_noise", "missed_contact"};
  return *names;
}

Hidden RealisticEffect(const std::string& effect, const Scenario& scenario, uint64_t seed) {
  auto random = Stream(seed, "effect");
  Hidden hidden = Drawn(effect, scenario, random);
  if (IsNoise(effect)) return hidden;
  const Set like = Generate(scenario, seed);
  while (Signal(hidden, scenario, like, like.exact_time_us, seed) < kMinRealistic)
    hidden = Scaled(hidden, 1.5);
  return hidden;
}

Hidden WeakEffect(const std::string& effect, const Scenario& scenario, uint64_t seed, double signal) {
  auto random = Stream(seed, "effect");
  Hidden whole = Drawn(effect, scenario, random);
  // One pose for all objects: a weak signal cannot determine thirty numbers.
  if (effect == "object_pose") whole.values.resize(6);
  const Set like = Generate(scenario, seed);
  const std::vector<double> without_us = TimesAwayFromEdges(like);
  double low = std::log(1e-3), high = std::log(30.0);
  for (int step = 0; step < 14; ++step) {
    const double middle = 0.5 * (low + high);
    const Hidden tried = Scaled(whole, std::exp(middle));
    (Signal(tried, scenario, like, without_us, seed) < signal ? low : high) = middle;
  }
  return Scaled(whole, std::exp(0.5 * (low + high)));
}

Unlisted UnlistedEffect(const std::string& name, const Scenario& scenario, uint64_t seed,
                        double rms_in_sigmas) {
  auto random = Stream(seed, "unlisted");
  Unlisted unlisted{name, 1, Between(3, 8, random)};
  Scenario with = scenario;
  with.unlisted.push_back(unlisted);
  const Set like = Generate(scenario, seed);
  const double signal = SignalInStandardErrors(ExactTimesUs(with, like, seed), like.exact_time_us,
                                               scenario.fingers, scenario.sigma_us);
  const double wanted = rms_in_sigmas * std::sqrt(like.touches * (scenario.fingers - 1.0));
  unlisted.k_mm = EitherSign(1, 1, random) * wanted / signal;
  return unlisted;
}

}  // namespace touchstone::hidden
