// For tests: an experiment whose prediction is synthetic, so that residuals are what the test wants.
#pragma once

#include <cmath>
#include <memory>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::touches {

constexpr double kSyntheticSigmaS = 0.005;

struct SyntheticSet {
  Observations observations;
  Prediction prediction;
  std::vector<double> residuals;

  // `objects` x `poses` x `rounds` touches, three fingers, incidence up to 30 deg, travel 40 to 90 mm.
  SyntheticSet(int objects, int poses, int rounds, double sigma_s, uint64_t seed) {
    auto set = std::make_shared<session::MeasurementSet>();
    set->fingers = observations.fingers = prediction.fingers = 3;
    set->has_poses = set->has_session_time = true;
    RandomStream random(seed, RandomDomain::kTest);
    for (int o = 0; o < objects; ++o) {
      set->objects.push_back("object" + std::to_string(o));
      observations.surfaces.push_back(nullptr);
    }
    observations.objects = set->objects;
    const int all_poses = objects * poses;
    std::vector<double> cosine(all_poses * 3), travel(all_poses * 3);
    std::vector<Eigen::Vector3d> approach(all_poses), lateral(all_poses);
    for (int p = 0; p < all_poses; ++p) {
      approach[p] = Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized();
      lateral[p] =
          approach[p].cross(Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal())).normalized();
      for (int i = 0; i < 3; ++i) {
        cosine[p * 3 + i] = std::cos(random.Uniform(0, 30) * kRadiansPerDegree);
        travel[p * 3 + i] = random.Uniform(0.040, 0.090);
      }
    }
    for (int round = 0; round < rounds; ++round) {
      for (int p = 0; p < all_poses; ++p) {
        const int k = observations.size();
        set->touch.push_back(k);
        set->object.push_back(p / poses);
        set->target_m.push_back(Eigen::Vector3d::Zero());
        set->approach.push_back(approach[p]);
        set->lateral.push_back(lateral[p]);
        set->standoff_m.push_back(0.06);
        set->speed_m_s.push_back(0.02);
        set->session_time_s.push_back(10.0 * k);
        set->round.push_back(round);
        set->face.push_back(p % 6);
        set->line.push_back(k + 2);
        observations.row.push_back(k);
        observations.object.push_back(p / poses);
        observations.pose.push_back(p);
        observations.used.push_back(1);
        observations.previous.push_back(k - 1);
        for (int i = 0; i < 3; ++i) {
          prediction.travel_m.push_back(travel[p * 3 + i]);
          prediction.time_s.push_back(travel[p * 3 + i] / 0.02);
          prediction.inverse_speed_s_per_m.push_back(50);
          prediction.cos_incidence.push_back(cosine[p * 3 + i]);
          prediction.previous_press_m.push_back(0.01 * random.Uniform());
          prediction.press_m.push_back(0);
          prediction.contact_m.push_back(0.05 *
                                         Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
          prediction.normal.push_back(-approach[p]);
          observations.time_s.push_back(prediction.time_s.back() + sigma_s * random.Normal());
        }
        const double* t = &prediction.time_s[k * 3];
        prediction.first_finger.push_back(t[0] <= t[1] && t[0] <= t[2] ? 0 : t[1] <= t[2] ? 1 : 2);
      }
    }
    observations.poses = all_poses;
    set->time_s = observations.time_s;
    observations.set = set;
    Finish();
  }

  int size() const { return observations.size(); }
  double IncidenceDeg(int k, int i) const {
    return std::acos(prediction.cos_incidence[k * 3 + i]) / kRadiansPerDegree;
  }
  // After the measured times were changed.
  void Finish() {
    residuals.assign(observations.time_s.size(), NAN);
    for (int k = 0; k < size(); ++k) {
      double mean = 0;
      int count = 0;
      for (int i = 0; i < 3; ++i) {
        const double d = observations.time_s[k * 3 + i] - prediction.time_s[k * 3 + i];
        if (!std::isnan(d)) mean += d, ++count;
      }
      if (count < 2) continue;
      for (int i = 0; i < 3; ++i)
        residuals[k * 3 + i] = observations.time_s[k * 3 + i] - prediction.time_s[k * 3 + i] - mean / count;
    }
  }
};

// Five objects, 48 poses; contacts whose normals differ from finger to finger.
inline SyntheticSet TiltedSet(uint64_t seed, int rounds = 4) {
  SyntheticSet set(5, 48, rounds, kSyntheticSigmaS, seed);
  RandomStream random(1, RandomDomain::kTest);
  std::vector<Eigen::Vector3d> normal(set.observations.poses * 3), contact_m(normal.size());
  for (size_t e = 0; e < normal.size(); ++e) {
    normal[e] = Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()) * 0.25;
    contact_m[e] = Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()) * 0.05;
  }
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i) {
      const size_t e = set.observations.pose[k] * 3 + i;
      set.prediction.normal[k * 3 + i] = (normal[e] - set.observations.set->approach[k]).normalized();
      set.prediction.contact_m[k * 3 + i] = contact_m[e];
      set.prediction.cos_incidence[k * 3 + i] =
          -set.prediction.normal[k * 3 + i].dot(set.observations.set->approach[k]);
    }
  return set;
}

// How much later finger i of touch k meets a surface that `move_m` has shifted.
inline double LaterBy(const SyntheticSet& set, int k, int i, const Eigen::Vector3d& move_m) {
  const Eigen::Vector3d& n = set.prediction.normal[k * 3 + i];
  return n.dot(move_m) / n.dot(set.observations.set->approach[k]) *
         set.prediction.inverse_speed_s_per_m[k * 3 + i];
}

// Contacts come early by 1 ms per degree of incidence, on every finger.
inline SyntheticSet EarlyOnSlopes() {
  SyntheticSet set(5, 48, 4, kSyntheticSigmaS, 1);
  for (int k = 0; k < set.size(); ++k)
    for (int i = 0; i < 3; ++i) set.observations.time_s[k * 3 + i] -= 1e-3 * set.IncidenceDeg(k, i);
  set.Finish();
  return set;
}

}  // namespace touchstone::diagnosis::touches
