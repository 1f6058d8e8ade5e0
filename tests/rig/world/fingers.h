// The fingers of the emulated end effector, and the object that they run into: when each makes contact while
// the arm moves, and when its sensor says so. The physics is the oracle's of tests/hidden_effects/generator
// (double precision, written from the catalogue's definitions), which shares nothing with server/touch.
//
// A straight motion along the tool's own z is an approach. The oracle gives the time t_i of finger i's
// contact at the commanded speed; the contact happens when the arm has in fact come speed * t_i far, so that
// ramps, stops and speed scaling act as they would. Latency, slip, drift, hysteresis and noise then shift the
// sensor's edge, to before the contact if need be; clock_skew multiplies the time since the approach began,
// since the gateway would correct a device whose clock really ran fast; poll_interval rounds it up. Session
// time is 0 at the first approach with a contact.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tests/hidden_effects/generator/rig.h"
#include "tests/rig/world.h"

namespace touchstone::rig {

// What really happened in one approach; simulated seconds. NaN where a finger made no contact,
// or reported none.
struct TouchTruth {
  uint64_t number = 0;  // counts approaches with a contact, from 1
  std::string object, up_face;
  double start_s = 0;                                           // when the approach began, SimClock
  double session_time_s = 0;                                    // since the first one
  double speed_m_s = 0;                                         // commanded
  Eigen::Vector3d start_in_object_m = Eigen::Vector3d::Zero();  // of the middle finger's tip
  Eigen::Vector3d approach = Eigen::Vector3d::Zero(),
                  lateral = Eigen::Vector3d::Zero();  // object frame, unit
  std::vector<double> travel_m;                       // of the arm at each contact
  std::vector<double> contact_s;   // since start_s: the contact itself, without anything that the sensor adds
  std::vector<double> reported_s;  // since start_s: the sensor's edge
  bool ended = false;
};

// A change of a finger's sensor. `at_s` is when the hardware captures it; it may be handed over
// from `known_s` on, which is never before it was decided and late enough that edges come in the
// order of their times.
struct Edge {
  int finger = 0;
  bool pressed = false;
  double at_s = 0, known_s = 0;
};

class Fingers : public TipListener {
 public:
  // `base_from_object` is that with face "+z" up, by the names of scenario.objects. Throws std::invalid_argument
  // for a hidden effect that does not exist. `sink` is called from the controller's thread.
  Fingers(const hidden::Scenario& scenario, uint64_t seed,
          std::map<std::string, Eigen::Isometry3d> base_from_object, const Faults* faults,
          std::function<void(const Edge&)> sink);

  // Puts an object on the fixture; an empty name takes it away. An error text, or empty.
  std::string Mount(const std::string& object, const std::string& up_face);
  std::string object() const;
  std::string up_face() const;
  // Where the mounted object's mesh truly is, hidden pose and size included; none if nothing is mounted.
  std::optional<Eigen::Affine3d> BaseFromMesh() const;

  // Every approach with a contact so far, the newest last (at most the last 10,000).
  std::vector<TouchTruth> Touches() const;
  uint64_t touches() const;
  // From the next approach on session time counts from 0 again.
  void RestartSession();

  void OnMotionBegan(const StraightMotion& motion) override;
  double OnProgress(uint64_t number, double now_s, double distance_m,
                    const std::function<double(double)>& distance_at) override;
  void OnMotionEnded(uint64_t number, double now_s) override;
  double IndentationM() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return indentation_m_;
  }

 private:
  // Chance, a stream for each purpose; copied with the rig, so that an approach in the air changes nothing.
  struct Chance {
    explicit Chance(uint64_t seed);
    std::mt19937_64 scatter, ticks, losses, wild;
  };
  struct Session {
    hidden::Rig rig;
    Chance chance;
  };
  // One finger's part of an approach.
  struct Plan {
    bool hit = false;
    double contact_m = 0;  // of the arm's way
    double sensor_s = 0;   // added by the sensor without chance
    double scatter_s = 0;  // noise and outlier
    bool lost = false;
    bool contacted = false, pressed = false;
    double edge_s = 0;  // when its contact edge was captured
  };
  struct Approach {
    StraightMotion motion;
    Eigen::Vector3d from = Eigen::Vector3d::Zero(), axis = Eigen::Vector3d::UnitZ();
    TouchTruth truth;
    Session after;  // the session's state once a contact has been made
    std::vector<Plan> fingers;
    double poll_phase_s = 0;
    double hold_s = 0;   // how long edges are held back so that they come in order
    bool begun = false;  // a contact has been made
  };
  Approach PlanApproach(const StraightMotion& motion, const Eigen::Vector3d& axis) const;
  double ReportedS(const Approach& approach, const Plan& finger, double contact_s) const;
  void Contact(int finger, double at_s);
  void Release(int finger, double at_s, double now_s);
  bool AnyPressed() const;
  Eigen::Isometry3d BaseFromObject() const;
  int Object() const;

  const hidden::Scenario scenario_;
  const std::map<std::string, Eigen::Isometry3d> base_from_object_;
  const Faults* const faults_;
  const std::function<void(const Edge&)> sink_;

  mutable std::mutex mutex_;
  std::string object_, up_face_ = "+z";
  Session session_;
  std::optional<double> session_began_s_;
  std::optional<Approach> approach_;
  std::vector<TouchTruth> truths_;
  uint64_t touches_ = 0;

  // The motion under way, along the axis of the approach: how far from the approach's start it began, and
  // what a metre of it adds.
  uint64_t motion_ = 0;
  double offset_m_ = 0, along_ = 0, last_progress_s_ = 0, last_distance_m_ = 0;
  double indentation_m_ = 0;
};

}  // namespace touchstone::rig
