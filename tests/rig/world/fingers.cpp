#include "tests/rig/world/fingers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "server/geometry/pose.h"
#include "tests/rig/world/resting_face.h"

namespace touchstone::rig {
namespace {

using Vec = Eigen::Vector3d;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kNoTails = 1000;  // degrees of freedom that are as good as normal
constexpr double kMinMotionM = 1e-6;
constexpr double kAlongAxis = 0.9998;         // cosine of 1 deg
constexpr double kOffAxisM = 0.005;           // a motion that begins farther aside has left the object
constexpr double kReleaseHysteresisM = 5e-5;  // an optical interrupter's
constexpr double kControlCycleS = 0.008;      // contacts become known so late at most
constexpr double kMaxHoldS = 0.25;
constexpr double kMinPressS = 0.001;
constexpr size_t kMaxTruths = 10'000;

// The moment in (from_s, until_s] at which the arm has come so far.
double TimeOf(double distance_m, double from_s, double until_s,
              const std::function<double(double)>& distance_at) {
  double low = from_s, high = until_s;
  for (int k = 0; k < 60 && high - low > 1e-10; ++k) {
    const double middle = 0.5 * (low + high);
    (distance_at(middle) < distance_m ? low : high) = middle;
  }
  return high;
}

// The room warms and cools; only the unlisted effect warm_bar cares.
double RoomDegrees(double now_s) {
  return 23 + 2 * std::sin(2 * M_PI * now_s / 3000);
}

}  // namespace

Fingers::Chance::Chance(uint64_t seed)
    : scatter(hidden::Stream(seed, "noise")),
      ticks(hidden::Stream(seed, "ticks")),
      losses(hidden::Stream(seed, "loss")),
      wild(hidden::Stream(seed, "wild")) {}

Fingers::Fingers(const hidden::Scenario& scenario, uint64_t seed,
                 std::map<std::string, Eigen::Isometry3d> base_from_object, const Faults* faults,
                 std::function<void(const Edge&)> sink)
    : scenario_(scenario),
      base_from_object_(std::move(base_from_object)),
      faults_(faults),
      sink_(std::move(sink)),
      session_{hidden::Rig(scenario, seed), Chance(seed)} {
  for (const auto& object : scenario_.objects)
    if (base_from_object_.count(object->name()) == 0)
      throw std::invalid_argument("object '" + object->name() + "' has no place on the fixture");
}

int Fingers::Object() const {
  for (size_t k = 0; k < scenario_.objects.size(); ++k)
    if (scenario_.objects[k]->name() == object_) return static_cast<int>(k);
  return -1;
}

std::string Fingers::Mount(const std::string& object, const std::string& up_face) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto& names = FaceNames();
  if (std::find(names.begin(), names.end(), up_face) == names.end())
    return "no face is called '" + up_face + "'; there are +x, -x, +y, -y, +z, -z";
  if (AnyPressed()) return "the fingers are on object '" + object_ + "'; retreat first";
  const std::string before = object_;
  object_ = object;
  if (!object.empty() && Object() < 0) {
    object_ = before;
    std::string known;
    for (const auto& each : scenario_.objects) known += (known.empty() ? "" : ", ") + each->name();
    return "there is no object '" + object + "'; there are " + known;
  }
  up_face_ = up_face;
  approach_.reset();
  return "";
}

std::string Fingers::object() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return object_;
}

std::string Fingers::up_face() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return up_face_;
}

Eigen::Isometry3d Fingers::BaseFromObject() const {
  const hidden::Solid& solid = *scenario_.objects[Object()];
  return BaseFromPlacedObject(base_from_object_.at(object_), solid.low_mm() * 1e-3, solid.high_mm() * 1e-3,
                              up_face_);
}

std::optional<Eigen::Affine3d> Fingers::BaseFromMesh() const {
  std::lock_guard<std::mutex> lock(mutex_);
  const int object = Object();
  if (object < 0) return std::nullopt;
  Eigen::Affine3d object_from_mesh = Eigen::Affine3d::Identity();
  for (const hidden::Hidden& hidden : scenario_.hidden) {
    if (hidden.effect != "object_pose") continue;
    const double* six = hidden.values.data() + (hidden.values.size() > 6 ? 6 * object : 0);
    object_from_mesh.translation() = Vec(six[0], six[1], six[2]) * 1e-3;
    object_from_mesh.linear() = geometry::RotationFromVector(Vec(six[3], six[4], six[5]) * (M_PI / 180));
  }
  object_from_mesh.linear() *= 1 + session_.rig.Value("object_scale");
  return Eigen::Affine3d(BaseFromObject()) * object_from_mesh;
}

std::vector<TouchTruth> Fingers::Touches() const {
  std::lock_guard<std::mutex> lock(mutex_);
  std::vector<TouchTruth> all = truths_;
  if (approach_ && approach_->begun && !approach_->truth.ended) all.push_back(approach_->truth);
  return all;
}

uint64_t Fingers::touches() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return touches_;
}

void Fingers::RestartSession() {
  std::lock_guard<std::mutex> lock(mutex_);
  session_began_s_.reset();
}

bool Fingers::AnyPressed() const {
  if (!approach_) return false;
  for (const Plan& finger : approach_->fingers)
    if (finger.pressed) return true;
  return false;
}

Fingers::Approach Fingers::PlanApproach(const StraightMotion& motion, const Vec& axis) const {
  const Eigen::Isometry3d object_from_base = BaseFromObject().inverse();
  TouchTruth truth;
  truth.object = object_, truth.up_face = up_face_;
  truth.start_s = motion.start_s;
  truth.session_time_s = session_began_s_ ? motion.start_s - *session_began_s_ : 0;
  truth.speed_m_s = motion.speed_m_s;
  truth.start_in_object_m = object_from_base * motion.from.translation();
  truth.approach = (object_from_base.linear() * axis).normalized();
  const Vec lateral = object_from_base.linear() * motion.from.linear().col(0);
  truth.lateral = (lateral - truth.approach * truth.approach.dot(lateral)).normalized();
  for (auto* times : {&truth.travel_m, &truth.contact_s, &truth.reported_s})
    times->assign(scenario_.fingers, kNone);

  // Only the start and the directions matter; the target is where the standoff of the scenario puts it.
  hidden::Command command;
  command.object = Object();
  command.approach = truth.approach, command.lateral = truth.lateral;
  command.standoff_mm = scenario_.standoff_mm, command.speed_mm_s = motion.speed_m_s * 1e3;
  command.target_mm = truth.start_in_object_m * 1e3 + truth.approach * scenario_.standoff_mm;

  Approach out{motion, motion.from.translation(), axis, std::move(truth), session_, {}, 0, 0, false};
  hidden::Rig& rig = out.after.rig;
  const auto found =
      rig.Touch(command, command.speed_mm_s, out.truth.session_time_s, RoomDegrees(motion.start_s));

  // Chance: the same kinds as the oracle's, and as many numbers whatever is hidden.
  Chance& chance = out.after.chance;
  std::uniform_real_distribution<double> part(0, 1);
  const double degrees = rig.Value("heavy_tail_noise", 0, kNoTails), slope = rig.Value("incidence_noise");
  const double sigma_us = rig.Value("gaussian_noise", 0, scenario_.sigma_us);
  const double lost = 1 - (1 - rig.Value("missed_contact")) * (1 - scenario_.missing_share);
  out.poll_phase_s = rig.Value("poll_interval") * 1e-6 * part(chance.ticks);
  for (const hidden::Rig::Finger& finger : found) {
    std::normal_distribution<double> normal;
    double deviate = normal(chance.scatter);
    if (degrees < kNoTails)
      deviate /= std::sqrt(std::gamma_distribution<double>(degrees / 2, 2 / degrees)(chance.scatter));
    Plan plan;
    plan.hit = finger.hit;
    plan.contact_m = finger.time_s * motion.speed_m_s;
    plan.sensor_s = finger.reported_s - finger.time_s;
    plan.scatter_s = 1e-6 * sigma_us * (1 + slope * finger.tan_incidence) * deviate * rig.clock_factor();
    const bool wild = part(chance.wild) < scenario_.outlier_share;
    const double outlier_us = scenario_.outlier_us * (0.3 + 0.7 * part(chance.wild));
    const double side = part(chance.wild) < 0.5 ? -1 : 1;
    if (wild) plan.scatter_s += 1e-6 * outlier_us * side;
    plan.lost = part(chance.losses) < lost;
    if (plan.hit) out.hold_s = std::max(out.hold_s, finger.time_s - ReportedS(out, plan, finger.time_s));
    out.fingers.push_back(plan);
  }
  out.hold_s = std::min(out.hold_s, kMaxHoldS) + kControlCycleS;
  return out;
}

double Fingers::ReportedS(const Approach& approach, const Plan& finger, double contact_s) const {
  const double clock = approach.after.rig.clock_factor();
  const double interval_s = 1e-6 * approach.after.rig.Value("poll_interval");
  double reported_s = (contact_s + finger.sensor_s) * clock + finger.scatter_s;
  if (interval_s > 0)
    reported_s =
        std::ceil((reported_s - approach.poll_phase_s) / interval_s) * interval_s + approach.poll_phase_s;
  return reported_s;
}

void Fingers::OnMotionBegan(const StraightMotion& motion) {
  std::lock_guard<std::mutex> lock(mutex_);
  motion_ = motion.number;
  last_progress_s_ = motion.start_s, last_distance_m_ = 0;
  const Vec way = motion.to.translation() - motion.from.translation();
  const Vec direction = way.norm() > kMinMotionM ? Vec(way.normalized()) : Vec(Vec::Zero());

  if (approach_) {
    const Vec from = motion.from.translation() - approach_->from;
    offset_m_ = from.dot(approach_->axis), along_ = direction.dot(approach_->axis);
    if ((from - approach_->axis * offset_m_).norm() > kOffAxisM)
      for (size_t i = 0; i < approach_->fingers.size(); ++i) Release(i, motion.start_s, motion.start_s);
  }
  if (AnyPressed()) return;
  approach_.reset();
  if (Object() < 0 || motion.speed_m_s <= 0 || direction.dot(motion.from.linear().col(2)) < kAlongAxis)
    return;
  approach_ = PlanApproach(motion, direction);
  offset_m_ = 0, along_ = 1;
}

void Fingers::Contact(int i, double at_s) {
  Approach& approach = *approach_;
  Plan& finger = approach.fingers[i];
  if (!approach.begun) {
    approach.begun = true;
    session_ = approach.after;
    if (!session_began_s_) session_began_s_ = approach.motion.start_s;
    approach.truth.number = ++touches_;
  }
  finger.contacted = finger.pressed = true;
  const double contact_s = at_s - approach.motion.start_s;
  approach.truth.contact_s[i] = contact_s;
  approach.truth.travel_m[i] = finger.contact_m;
  const double reported_s = ReportedS(approach, finger, contact_s);
  finger.edge_s = approach.motion.start_s + reported_s;
  if (finger.lost || faults_->Get("missing_finger") == i) return;
  approach.truth.reported_s[i] = reported_s;
  sink_({i, true, finger.edge_s, finger.edge_s + approach.hold_s});
}

void Fingers::Release(int i, double at_s, double now_s) {
  Plan& finger = approach_->fingers[i];
  if (!finger.pressed) return;
  finger.pressed = false;
  if (std::isnan(approach_->truth.reported_s[i])) return;
  const double edge_s = std::max(at_s, finger.edge_s + kMinPressS);
  sink_({i, false, edge_s, std::max(now_s, edge_s + approach_->hold_s)});
}

double Fingers::OnProgress(uint64_t number, double now_s, double distance_m,
                           const std::function<double(double)>& distance_at) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (number != motion_ || !approach_) return 0;
  const double position_m = offset_m_ + along_ * distance_m;
  double push_m = 0;
  indentation_m_ = 0;
  for (size_t i = 0; i < approach_->fingers.size(); ++i) {
    Plan& finger = approach_->fingers[i];
    if (!finger.hit) continue;
    const double free_m = finger.contact_m - kReleaseHysteresisM;
    if (along_ > 0 && !finger.contacted && position_m >= finger.contact_m)
      Contact(i, TimeOf((finger.contact_m - offset_m_) / along_, last_progress_s_, now_s, distance_at));
    else if (along_ < 0 && finger.pressed && position_m <= free_m)
      Release(i, TimeOf((free_m - offset_m_) / along_, last_progress_s_, now_s, distance_at), now_s);
    if (!finger.pressed) continue;
    push_m = std::max(push_m, position_m - finger.contact_m);
    indentation_m_ += std::max(0.0, position_m - finger.contact_m);
  }
  last_progress_s_ = now_s, last_distance_m_ = distance_m;
  return push_m;
}

void Fingers::OnMotionEnded(uint64_t number, double now_s) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (number != motion_ || !approach_ || approach_->motion.number != number) return;
  Approach& approach = *approach_;
  if (!approach.begun || approach.truth.ended) return;
  approach.truth.ended = true;
  truths_.push_back(approach.truth);
  if (truths_.size() > kMaxTruths) truths_.erase(truths_.begin());

  // A finger that the arm did not bring to its contact was not the last one, whatever the oracle foresaw.
  double last_m = 0;
  bool all = true;
  for (const Plan& finger : approach.fingers) {
    if (finger.contacted) last_m = std::max(last_m, finger.contact_m);
    all = all && finger.contacted == finger.hit;
  }
  if (all) return;
  std::vector<double> pressed_mm;
  for (const Plan& finger : approach.fingers)
    pressed_mm.push_back(finger.contacted ? (last_m - finger.contact_m) * 1e3 : 0);
  session_.rig.Remember(std::move(pressed_mm));
}

}  // namespace touchstone::rig
