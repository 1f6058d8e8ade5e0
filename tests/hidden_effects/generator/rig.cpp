#include "tests/hidden_effects/generator/rig.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tests/hidden_effects/generator/unlisted.h"

namespace touchstone::hidden {
namespace {

using Vec = Eigen::Vector3d;

constexpr double kRadians = M_PI / 180;
constexpr double kNoRamp = 1e6;

struct Known {
  const char* effect;
  int scalars;  // -1: one per finger
  bool noise;
};
constexpr Known kKnown[] = {
    {"tool_yaw", 1, false},        {"tool_tilt", 1, false},         {"finger_spacing", 1, false},
    {"finger_length", -1, false},  {"gravity_sag", 1, false},       {"object_scale", 1, false},
    {"object_pose", 6, false},     {"tip_radius", 1, false},        {"surface_error", 2, false},
    {"speed_error", 1, false},     {"acceleration_ramp", 1, false}, {"contact_slowdown", 1, false},
    {"object_push", 1, false},     {"oblique_slip", 1, false},      {"channel_latency", -1, false},
    {"thermal_drift", -1, false},  {"return_hysteresis", 1, false}, {"clock_skew", 1, false},
    {"poll_interval", 1, true},    {"gaussian_noise", 1, true},     {"incidence_noise", 1, true},
    {"heavy_tail_noise", 1, true}, {"missed_contact", 1, true},     {"correlated_noise", 2, true},
};

const Known& FindKnown(const std::string& effect) {
  for (const Known& known : kKnown)
    if (effect == known.effect) return known;
  throw std::invalid_argument("no effect of the catalogue is called " + effect);
}

}  // namespace

int ValueCount(const std::string& effect, int fingers) {
  const int scalars = FindKnown(effect).scalars;
  return scalars < 0 ? fingers : scalars;
}

bool IsNoise(const std::string& effect) {
  return FindKnown(effect).noise;
}

std::mt19937_64 Stream(uint64_t seed, const char* purpose) {
  std::seed_seq words{static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32),
                      static_cast<uint32_t>(purpose[0]) << 16 | static_cast<uint32_t>(purpose[1]) << 8 |
                          static_cast<uint32_t>(purpose[2])};
  return std::mt19937_64(words);
}

Rig::Rig(const Scenario& scenario, uint64_t seed)
    : scenario_(scenario), seed_(seed), bumps_(scenario.objects.size()), pressed_mm_(scenario.fingers, 0) {
  for (const Hidden& hidden : scenario.hidden) {
    const size_t count = ValueCount(hidden.effect, scenario.fingers);
    if (hidden.values.size() != count &&
        !(hidden.effect == "object_pose" && hidden.values.size() == count * scenario.objects.size()))
      throw std::invalid_argument("wrong number of values for " + hidden.effect);
    values_[hidden.effect] = hidden.values;
  }
  if (Value("surface_error") != 0) {
    auto random = Stream(seed, "bumps");
    for (size_t k = 0; k < bumps_.size(); ++k)
      bumps_[k] = Bumps(*scenario.objects[k], Value("surface_error"), Value("surface_error", 1), random);
  }
}

double Rig::Value(const std::string& effect, int index, double neutral) const {
  const auto found = values_.find(effect);
  return found == values_.end() ? neutral : found->second[index];
}

const Cause* Rig::Find(CauseKind kind) const {
  for (const Cause& cause : scenario_.causes)
    if (cause.kind == kind) return &cause;
  return nullptr;
}

std::vector<Rig::Landing> Rig::Land(const Command& command) const {
  Vec a = command.approach, across = command.lateral;
  if (const Cause* error = Find(CauseKind::kPoseError); error != nullptr && command.pose >= 0) {
    const Eigen::Matrix3d rotated = TiltOf(*error, seed_, command.pose, a, across);
    a = rotated * a, across = rotated * across;
  }
  // The real row of fingers.
  const double yaw = Value("tool_yaw") * kRadians;
  const Vec lateral = Eigen::AngleAxisd(yaw, a) * across;
  const double spacing = scenario_.spacing_mm + Value("finger_spacing");
  // The real object is the mesh under v -> R (size v) + moved; lines get the inverse transform.
  const double size = 1 + Value("object_scale");
  Vec turn = Vec::Zero(), moved = Vec::Zero();
  if (const auto pose = values_.find("object_pose"); pose != values_.end()) {
    const double* six = pose->second.data() + (pose->second.size() > 6 ? 6 * command.object : 0);
    moved = Vec(six[0], six[1], six[2]);
    turn = Vec(six[3], six[4], six[5]) * kRadians;
  }
  Eigen::Matrix3d back = Eigen::Matrix3d::Identity();
  if (turn.norm() > 0)
    back = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix().transpose();
  if (const Cause* remounted = Find(CauseKind::kRemounted)) {
    const Placement placement = PlacementOf(*remounted, seed_, command.object, command.round);
    moved = placement.turned * moved + placement.moved_mm;
    back = back * placement.turned.transpose();
  }

  const double standoff = command.standoff_mm > 0 ? command.standoff_mm : scenario_.standoff_mm;
  std::vector<Landing> landings;
  for (int i = 0; i < scenario_.fingers; ++i) {
    const double x = (i - 0.5 * (scenario_.fingers - 1)) * spacing;
    const Vec tip = command.target_mm - a * standoff + lateral * x - Vec(0, 0, Value("gravity_sag"));
    const Vec way = back * a;
    const Contact contact = scenario_.objects[command.object]->FirstContact(back * (tip - moved) / size, way,
                                                                            Value("tip_radius") / size);
    Landing landing{contact.hit, 0, 0, 0, Vec::Zero()};
    if (contact.hit) {
      landing.cosine = std::clamp(-way.dot(contact.outward), 1e-6, 1.0);
      landing.tangent = std::sqrt(1 - landing.cosine * landing.cosine) / landing.cosine;
      landing.travel_mm = contact.travel_mm * size;
      landing.contact_mm = back.transpose() * (contact.point_mm * size) + moved;
      landing.travel_mm -= bumps_[command.object].HeightMm(contact.point_mm) / std::max(landing.cosine, 0.05);
      landing.travel_mm += x * std::tan(Value("tool_tilt") * kRadians) + Value("finger_length", i);
    }
    landings.push_back(landing);
  }
  return landings;
}

std::vector<Rig::Landing> Rig::Landed(const Command& command) {
  if (command.pose < 0) return Land(command);
  const int round = Find(CauseKind::kRemounted) != nullptr ? command.round : 0;
  std::vector<Landing>& known = landed_[{command.pose, round}];
  if (known.empty()) known = Land(command);
  return known;
}

std::vector<double> Rig::AddedTravelMm(const std::vector<Landing>& landings, int first,
                                       const Command& command, double session_time_s,
                                       double temperature) const {
  const int fingers = scenario_.fingers;
  std::vector<double> added(fingers, 0);
  for (int i = 0; i < fingers; ++i) {
    const Landing& landing = landings[i];
    FingerState state;
    state.finger = i - 0.5 * (fingers - 1);
    state.travel_mm = landing.travel_mm, state.standoff_mm = scenario_.standoff_mm;
    state.first_finger = first - 0.5 * (fingers - 1);
    state.temperature = temperature;
    state.approach = command.approach, state.lateral = command.lateral, state.contact_mm = landing.contact_mm;
    for (const Unlisted& unlisted : scenario_.unlisted)
      added[i] += unlisted.k_mm * FindUnlisted(unlisted.name).travel(state, unlisted.second);
    TouchState touch{command.object, i, session_time_s, landing.tangent, i == first, 0, command.round};
    if (i > 0 && i + 1 < fingers && landings[i - 1].hit && landings[i + 1].hit)
      touch.neighbours_mm = landings[i - 1].travel_mm - landings[i + 1].travel_mm;
    for (const Cause& cause : scenario_.causes) added[i] += TravelMm(cause, touch);
  }
  return added;
}

std::vector<Rig::Finger> Rig::Touch(const Command& command, double commanded_mm_s, double session_time_s,
                                    double temperature) {
  const int fingers = scenario_.fingers;
  std::vector<Landing> landings = Landed(command);
  int first = -1;
  for (int i = 0; i < fingers; ++i)
    if (landings[i].hit && (first < 0 || landings[i].travel_mm < landings[first].travel_mm)) first = i;
  std::vector<Finger> out(fingers);
  if (first < 0) return out;

  // Travel added to each finger by effects of the motion and the contact.
  const std::vector<double> added = AddedTravelMm(landings, first, command, session_time_s, temperature);
  for (int i = 0; i < fingers; ++i)
    landings[i].travel_mm += added[i] + (i == first ? 0 : Value("object_push"));

  // The motion: speed, ramp from rest, and the brake of the first contact.
  const double speed = commanded_mm_s * (1 + Value("speed_error"));
  const double acceleration = Value("acceleration_ramp", 0, kNoRamp);
  const double ramp_mm = acceleration < kNoRamp ? speed * speed / (2 * acceleration) : 0;
  std::vector<double> speed_there(fingers, speed);
  for (int i = 0; i < fingers; ++i) {
    const double d = landings[i].travel_mm;
    out[i].hit = landings[i].hit;
    out[i].tan_incidence = landings[i].tangent;
    if (d < ramp_mm && d > 0) {
      out[i].time_s = std::sqrt(2 * d / acceleration);
      speed_there[i] = acceleration * out[i].time_s;
    } else {
      out[i].time_s = (d + ramp_mm) / speed;
    }
  }
  const double left = 1 - Value("contact_slowdown");
  for (int i = 0; i < fingers; ++i) {
    if (i == first) continue;
    out[i].time_s = out[first].time_s + (out[i].time_s - out[first].time_s) / left;
    speed_there[i] *= left;
  }

  // The sensor, as far as it is not random.
  double last_s = -1e300;
  for (int i = 0; i < fingers; ++i)
    if (out[i].hit) last_s = std::max(last_s, out[i].time_s);
  for (int i = 0; i < fingers; ++i) {
    const double extra_mm = Value("oblique_slip") * landings[i].tangent +
                            Value("thermal_drift", i) * session_time_s / 3600 -
                            Value("return_hysteresis") * pressed_mm_[i];
    out[i].reported_s = out[i].time_s + extra_mm / speed_there[i] + Value("channel_latency", i) * 1e-6;
  }
  for (int i = 0; i < fingers; ++i)
    pressed_mm_[i] = out[i].hit ? (last_s - out[i].time_s) * commanded_mm_s : 0;
  return out;
}

}  // namespace touchstone::hidden
