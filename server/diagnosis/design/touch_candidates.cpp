#include "server/diagnosis/design/touch_candidates.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/touches/prediction.h"
#include "server/touch/plan.h"

namespace touchstone::diagnosis::design {
namespace {

constexpr double kSpeedFactors[] = {1, 0.5, 2};

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// The same objects without touches.
touches::Observations Blank(const touches::Observations& like) {
  touches::Observations blank;
  blank.fingers = like.fingers;
  blank.objects = like.objects;
  blank.surfaces = like.surfaces;
  return blank;
}

void Append(const touch::TouchPose& pose, int object, double speed_m_s, double session_time_s,
            session::MeasurementSet* set) {
  set->touch.push_back(set->touch.size());
  set->object.push_back(object);
  set->target_m.push_back(pose.target_m);
  set->approach.push_back(pose.approach);
  set->lateral.push_back(pose.lateral);
  set->standoff_m.push_back(pose.standoff_m);
  set->speed_m_s.push_back(speed_m_s);
  set->session_time_s.push_back(session_time_s);
  set->line.push_back(0);
}

void Number(const std::shared_ptr<const session::MeasurementSet>& set, touches::Observations* observations) {
  const int count = set->size();
  observations->set = set;
  observations->row.resize(count);
  std::iota(observations->row.begin(), observations->row.end(), 0);
  observations->object = set->object;
  observations->pose = observations->row;
  observations->poses = count;
  observations->used.assign(count, 1);
  observations->previous.assign(count, -1);
  observations->time_s.assign(static_cast<size_t>(count) * observations->fingers, 0);
}

// Whether no finger of touch k meets an edge when the touch moves aside by near_edge_m: normal and travel
// change smoothly.
bool AwayFromEdges(const touches::Prediction& here, const touches::Prediction& beside, int k) {
  for (int i = 0; i < here.fingers; ++i) {
    const size_t at = size_t(k) * here.fingers + i;
    if (std::isnan(beside.time_s[at])) return false;
    if (here.normal[at].dot(beside.normal[at]) <
        std::cos(kDesignRules.max_turn_of_normal_deg * kRadiansPerDegree))
      return false;
    // The travel may change by the step times the tangent of the incidence, and a little more.
    const double tangent =
        std::sqrt(std::max(0.0, 1 / std::max(1e-3, std::pow(here.cos_incidence[at], 2)) - 1));
    if (std::abs(here.travel_m[at] - beside.travel_m[at]) > kDesignRules.near_edge_m * (1 + 1.5 * tangent))
      return false;
  }
  return true;
}

// Poses of all faces of all objects, each at every speed.
std::shared_ptr<const session::MeasurementSet> DrawSet(const touches::Observations& observations,
                                                       const CandidateChoice& choice) {
  const session::MeasurementSet& old = *observations.set;
  const double speed_m_s = Median(old.speed_m_s), standoff_m = Median(old.standoff_m);
  const double last_s = *std::max_element(old.session_time_s.begin(), old.session_time_s.end());
  const int objects = static_cast<int>(observations.objects.size());
  const int speeds = static_cast<int>(std::size(kSpeedFactors));
  auto set = std::make_shared<session::MeasurementSet>();
  set->origin = "candidates";
  set->fingers = observations.fingers;
  set->has_poses = true;
  set->has_session_time = old.has_session_time || choice.different_times;
  set->objects = observations.objects;
  touch::Plan plan;
  plan.kind = touch::Plan::Kind::kFaces;
  plan.faces.max_tilt_rad = choice.max_tilt_rad;
  plan.faces.spread = kDesignRules.spread;
  plan.faces.standoff_m = standoff_m;
  plan.faces.rounds = 1;
  plan.faces.samples_per_face = std::clamp(choice.max_candidates / (6 * speeds * objects), 4, 60);
  for (int o = 0; o < objects; ++o) {
    const auto generator =
        touch::MakePoseGenerator(plan, observations.surfaces[o]->bounds(), choice.seed * 1000 + o);
    std::vector<uint64_t> numbers(6 * plan.faces.samples_per_face);
    std::iota(numbers.begin(), numbers.end(), 0);
    std::vector<touch::TouchPose> poses(numbers.size());
    generator->Draw(numbers, 0, poses.data());
    for (size_t n = 0; n < poses.size(); ++n) {
      // Cold at the beginning of a new session, or long warm: where drifts differ most.
      const double time_s = choice.different_times && n % 2 ? std::max(3600.0, 2 * last_s)
                            : choice.different_times        ? 0
                                                            : last_s;
      for (const double factor : kSpeedFactors) Append(poses[n], o, factor * speed_m_s, time_s, set.get());
    }
  }
  for (const auto& [name, values] : old.covariates) set->covariates[name].assign(set->size(), Median(values));
  return set;
}

// Which candidates every finger completes away from edges; `here` is the prediction for them.
absl::StatusOr<std::vector<char>> CompletedAwayFromEdges(const touches::Observations& candidates,
                                                         const touches::Prediction& here,
                                                         const model::Model& model, ThreadPool* pool) {
  std::vector<char> good(candidates.size(), 1);
  for (int k = 0; k < candidates.size(); ++k)
    for (int i = 0; i < candidates.fingers; ++i)
      good[k] &= !std::isnan(here.time_s[size_t(k) * candidates.fingers + i]);
  for (const int direction : {0, 1, 2, 3}) {
    auto moved = std::make_shared<session::MeasurementSet>(*candidates.set);
    for (int k = 0; k < moved->size(); ++k) {
      const Eigen::Vector3d side =
          direction < 2 ? moved->lateral[k] : moved->approach[k].cross(moved->lateral[k]).eval();
      moved->target_m[k] +=
          (direction % 2 ? -kDesignRules.near_edge_m : kDesignRules.near_edge_m.value()) * side;
    }
    touches::Observations beside = Blank(candidates);
    Number(moved, &beside);
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction there,
                                touches::Predict(beside, model, true, false, pool));
    for (int k = 0; k < candidates.size(); ++k) good[k] = good[k] && AwayFromEdges(here, there, k);
  }
  return good;
}

}  // namespace

touches::Observations PartOf(const touches::Observations& observations, const std::vector<int>& keep) {
  touches::Observations part = Blank(observations);
  part.set = observations.set;
  std::vector<int> number(observations.size(), -1), pose(observations.poses, -1);
  for (size_t n = 0; n < keep.size(); ++n) {
    const int k = keep[n];
    number[k] = static_cast<int>(n);
    part.row.push_back(observations.row[k]);
    part.object.push_back(observations.object[k]);
    int& group = pose[observations.pose[k]];
    if (group < 0) group = part.poses++;
    part.pose.push_back(group);
    part.used.push_back(observations.used[k]);
    part.previous.push_back(observations.previous[k] < 0 ? -1 : number[observations.previous[k]]);
    for (int i = 0; i < observations.fingers; ++i)
      part.time_s.push_back(observations.time_s[size_t(k) * observations.fingers + i]);
  }
  return part;
}

absl::StatusOr<touches::Observations> MakeCandidates(const touches::Observations& observations,
                                                     const model::Model& model, const CandidateChoice& choice,
                                                     ThreadPool* pool) {
  touches::Observations candidates = Blank(observations);
  Number(DrawSet(observations, choice), &candidates);
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction here,
                              touches::Predict(candidates, model, true, false, pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<char> good,
                              CompletedAwayFromEdges(candidates, here, model, pool));
  std::vector<int> keep;
  for (int k = 0; k < candidates.size(); ++k)
    if (good[k]) keep.push_back(k);
  return PartOf(candidates, keep);
}

}  // namespace touchstone::diagnosis::design
