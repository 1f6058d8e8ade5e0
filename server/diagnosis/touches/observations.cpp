#include "server/diagnosis/touches/observations.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/touches/rules.h"

namespace touchstone::diagnosis::touches {
namespace {

absl::Status CheckInput(const DiagnosisInput& input) {
  const session::MeasurementSet& set = *input.set;
  if (set.fingers == 0)
    return absl::InvalidArgumentError(absl::StrCat(
        set.origin,
        ": the file has no times: it is a plan; measure it first, which fills t_l_us, t_m_us, ..."));
  if (set.fingers != input.model->fingers)
    return absl::InvalidArgumentError(absl::StrCat(
        set.origin, ": the file has times of ", set.fingers, " fingers, the model '", input.model->name,
        "' has ", input.model->fingers, "; end_effector.fingers of the model must agree"));
  if (set.fingers < 2)
    return absl::InvalidArgumentError(absl::StrCat(
        set.origin, ": only differences between fingers are compared, and there is but one finger"));
  if (set.size() == 0)
    return absl::InvalidArgumentError(absl::StrCat(set.origin, ": the file has a header and no touch"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckMeshes(input, set.origin, set.objects));
  return absl::OkStatus();
}

// The order of the session: the file's, unless its session times are clearly sorted otherwise.
std::vector<int> SessionOrder(const session::MeasurementSet& set) {
  std::vector<int> rows(set.size());
  std::iota(rows.begin(), rows.end(), 0);
  if (!set.has_session_time) return rows;
  int backward = 0;
  for (int k = 1; k < set.size(); ++k) backward += set.session_time_s[k] < set.session_time_s[k - 1];
  if (backward > kTouchRules.max_backward * set.size())
    std::stable_sort(rows.begin(), rows.end(),
                     [&](int a, int b) { return set.session_time_s[a] < set.session_time_s[b]; });
  return rows;
}

void FindPoses(Observations* o) {
  using Key = std::array<double, 12>;
  absl::flat_hash_map<Key, int> poses;
  const session::MeasurementSet& set = *o->set;
  o->pose.resize(o->size());
  for (int k = 0; k < o->size(); ++k) {
    const int row = o->row[k];
    Key key = {static_cast<double>(set.object[row]), set.standoff_m[row], set.speed_m_s[row]};
    for (int axis = 0; axis < 3; ++axis) {
      key[3 + axis] = set.target_m[row][axis];
      key[6 + axis] = set.approach[row][axis];
      key[9 + axis] = set.lateral[row][axis];
    }
    o->pose[k] = poses.emplace(key, static_cast<int>(poses.size())).first->second;
  }
  o->poses = static_cast<int>(poses.size());
}

// The largest distance along the approach between two fingers that touch the object, m: its box, and what it may lie or be
// larger.
double ThicknessAlong(const Observations& o, int k) {
  const geometry::Bounds& bounds = o.surfaces[o.object[k]]->bounds();
  return kTouchRules.larger_object * o.set->approach[o.row[k]].cwiseAbs().dot(bounds.max_m - bounds.min_m) +
         kTouchRules.object_apart;
}

// A few touches whose fingers cannot have met this object, whatever the model; many are no slips of single readings, and stay.
void LeaveOutImpossible(Observations* o) {
  std::vector<int> impossible;
  for (int k = 0; k < o->size(); ++k) {
    if (!o->used[k]) continue;
    double first_s = INFINITY, last_s = -INFINITY;
    for (int i = 0; i < o->fingers; ++i) {
      const double time_s = o->time_s[static_cast<size_t>(k) * o->fingers + i];
      if (!std::isnan(time_s)) first_s = std::min(first_s, time_s), last_s = std::max(last_s, time_s);
    }
    if ((last_s - first_s) * o->set->speed_m_s[o->row[k]] > ThicknessAlong(*o, k)) impossible.push_back(k);
  }
  if (static_cast<double>(impossible.size()) > std::max(1.0, kTouchRules.few_impossible * o->size())) return;
  for (const int k : impossible) LeaveOut(o, k, kImpossibleReason);
}

}  // namespace

absl::StatusOr<Observations> MakeObservations(const DiagnosisInput& input) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckInput(input));
  const session::MeasurementSet& set = *input.set;
  Observations o;
  o.set = input.set;
  o.fingers = set.fingers;
  o.objects = set.objects;
  for (const std::string& object : set.objects) o.surfaces.push_back(input.surfaces.at(object));
  o.row = SessionOrder(set);
  o.object.resize(o.size());
  o.used.assign(o.size(), 1);
  o.previous.assign(o.size(), -1);
  o.time_s.resize(static_cast<size_t>(o.size()) * o.fingers);
  for (int k = 0; k < o.size(); ++k) {
    const int row = o.row[k];
    o.object[k] = set.object[row];
    std::copy_n(&set.time_s[static_cast<size_t>(row) * o.fingers], o.fingers,
                &o.time_s[static_cast<size_t>(k) * o.fingers]);
    // Session time that falls begins a new session.
    if (k > 0 && (!set.has_session_time || set.session_time_s[row] >= set.session_time_s[o.row[k - 1]]))
      o.previous[k] = k - 1;
  }
  if (set.has_poses) FindPoses(&o);

  for (int k = 0; k < o.size(); ++k) {
    int reporting = 0;
    for (int i = 0; i < o.fingers; ++i)
      reporting += !std::isnan(o.time_s[static_cast<size_t>(k) * o.fingers + i]);
    if (reporting == 0) LeaveOut(&o, k, "no finger reported");
    if (reporting == 1) LeaveOut(&o, k, "only one finger reported: there is nothing to compare it with");
  }
  if (set.has_poses) LeaveOutImpossible(&o);
  return o;
}

std::vector<int> RoundsOfTouches(const Observations& o) {
  std::vector<int> rounds(o.size()), repeats(o.poses, 0);
  for (int k = 0; k < o.size(); ++k)
    rounds[k] = o.set->round.empty() ? repeats[o.pose[k]]++ : o.set->round[o.row[k]];
  return rounds;
}

void LeaveOut(Observations* observations, int k, const std::string& reason) {
  if (!observations->used[k]) return;
  observations->used[k] = 0;
  observations->unused[reason].push_back(k);
}

std::vector<int> LeftOutFor(const Observations& observations, const std::string& reason) {
  const auto found = observations.unused.find(reason);
  return found == observations.unused.end() ? std::vector<int>() : found->second;
}

const char* NameOfTime(const Observations& o) {
  return o.set->has_session_time ? "session_time_s" : "touch";
}

double PauseS(const Observations& o, int k) {
  if (!o.set->has_session_time || o.previous[k] < 0) return 0;
  return o.set->session_time_s[o.row[k]] - o.set->session_time_s[o.row[o.previous[k]]];
}

}  // namespace touchstone::diagnosis::touches
