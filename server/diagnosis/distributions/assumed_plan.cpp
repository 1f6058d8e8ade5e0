#include "server/diagnosis/distributions/assumed_plan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/numbers/random.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/diagnosis/distributions/two_samples.h"

namespace touchstone::diagnosis::distributions {
namespace {

double Median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// Distance of two touches by the times both have; NaN if a time is missing.
double Distance(const std::vector<double>& time_s, int fingers, int a, int b) {
  double sum = 0, squares = 0;
  for (int i = 0; i < fingers; ++i) {
    const double d = time_s[size_t(a) * fingers + i] - time_s[size_t(b) * fingers + i];
    sum += d, squares += d * d;
  }
  return std::sqrt(std::max(0.0, squares - sum * sum / fingers));
}

void PushIfNumber(double value, std::vector<double>* values) {
  if (!std::isnan(value)) values->push_back(value);
}

// The median distance of any two touches.
double TypicalDistance(const std::vector<double>& time_s, int fingers) {
  const int count = static_cast<int>(time_s.size()) / fingers;
  RandomStream random(0, RandomDomain::kDiagnosis, 0, 6);
  std::vector<double> distances;
  for (int n = 0; n < 1000; ++n) {
    const int a = static_cast<int>(random.Below(count)), b = static_cast<int>(random.Below(count));
    if (a != b) PushIfNumber(Distance(time_s, fingers, a, b), &distances);
  }
  return Median(distances);
}

// Rounds: a constant number of rows later the same touch comes again. The shortest period counts; 1: none.
int CountRounds(const std::vector<double>& time_s, int fingers, double typical_s) {
  const int count = static_cast<int>(time_s.size()) / fingers;
  for (int repeats = std::min(kDistributionRules.max_repeats.value(), count / 2); repeats >= 2; --repeats) {
    if (count % repeats != 0) continue;
    const int period = count / repeats;
    std::vector<double> again;
    const int step = std::max(1, (count - period) / 2000);
    for (int n = 0; n + period < count; n += step)
      PushIfNumber(Distance(time_s, fingers, n, n + period), &again);
    if (Median(again) < kDistributionRules.max_repeat_distance * typical_s) return repeats;
  }
  return 1;
}

// Repeats in any order: every touch has repeats - 1 neighbours much closer than the next.
int CountNeighbours(const std::vector<double>& time_s, int fingers, double typical_s) {
  const int count = static_cast<int>(time_s.size()) / fingers;
  const int looked_up = std::min(count, kDistributionRules.max_for_neighbours.value()),
            max_neighbours = std::min(kDistributionRules.max_repeats.value(), count - 1);
  std::vector<std::vector<double>> nearest(max_neighbours);
  for (int n = 0; n < looked_up; ++n) {
    std::vector<double> distances;
    const int mine = static_cast<int>(int64_t{n} * count / looked_up);
    for (int other = 0; other < count; ++other)
      if (other != mine) PushIfNumber(Distance(time_s, fingers, mine, other), &distances);
    if (static_cast<int>(distances.size()) < max_neighbours) continue;
    std::partial_sort(distances.begin(), distances.begin() + max_neighbours, distances.end());
    for (int r = 0; r < max_neighbours; ++r) nearest[r].push_back(distances[r]);
  }
  if (nearest[0].empty()) return 1;
  int repeats = 1;
  double widest = kDistributionRules.min_gap;
  for (int r = 0; r + 1 < max_neighbours; ++r) {
    const double here = Median(nearest[r]), next = Median(nearest[r + 1]);
    if (here < kDistributionRules.max_repeat_distance * typical_s && next > widest * here)
      repeats = r + 2, widest = next / here;
  }
  return repeats;
}

}  // namespace

int CountRepeats(const std::vector<double>& time_s, int fingers, bool* in_rounds) {
  *in_rounds = false;
  if (static_cast<int>(time_s.size()) / fingers < 4) return 1;
  const double typical_s = TypicalDistance(time_s, fingers);
  const int rounds = CountRounds(time_s, fingers, typical_s);
  *in_rounds = rounds > 1;
  return *in_rounds ? rounds : CountNeighbours(time_s, fingers, typical_s);
}

PoseFreeObject AssumePlan(const session::MeasurementSet& set, int object,
                          std::shared_ptr<const geometry::Surface> surface, double speed_m_s,
                          int max_touches) {
  PoseFreeObject result;
  result.surface = std::move(surface);
  std::vector<int> rows;
  std::vector<double> time_s;
  for (int row = 0; row < set.size(); ++row) {
    if (set.object[row] != object) continue;
    rows.push_back(row);
    for (int i = 0; i < set.fingers; ++i) time_s.push_back(set.TimeS(row, i));
  }
  result.repeats = CountRepeats(time_s, set.fingers, &result.in_rounds);
  const int count = static_cast<int>(rows.size());
  const int poses = (count + result.repeats - 1) / result.repeats;
  result.plan.kind = touch::Plan::Kind::kFaces;
  result.plan.speed_m_s = speed_m_s;
  result.plan.touch_interval_s = kDistributionRules.touch_interval_s;
  result.plan.faces.samples_per_face = (poses + 5) / 6;
  result.plan.faces.rounds = result.repeats;

  // Row n was the plan's touch n, unless a round of the plan has a few poses more than a round of the set.
  // Large sets are thinned by whole poses, evenly: so every face keeps its part.
  const int kept = std::max(1, std::min(poses, max_touches / result.repeats));
  const uint64_t poses_per_round = 6ull * result.plan.faces.samples_per_face;
  for (int n = 0; n < count; ++n) {
    const int64_t pose = n % poses;
    const int64_t slot =
        (pose * kept + poses - 1) / poses;  // the pose of this slot, if it is the slot's first
    if (slot >= kept || slot * poses / kept != pose) continue;
    result.rows.push_back(rows[n]);
    result.number.push_back(pose + poses_per_round * (n / poses));
  }
  return result;
}

RoundScatter ScatterAmongRounds(const session::MeasurementSet& set,
                                const std::vector<PoseFreeObject>& objects) {
  double squares = 0;
  RoundScatter scatter;
  for (const PoseFreeObject& object : objects) {
    if (!object.in_rounds) continue;
    const uint64_t poses_per_round = 6ull * object.plan.faces.samples_per_face;
    std::map<uint64_t, std::vector<std::vector<double>>> of_pose;
    for (size_t k = 0; k < object.rows.size(); ++k) {
      std::vector<double> times(set.fingers);
      double mean = 0;
      for (int i = 0; i < set.fingers; ++i) mean += (times[i] = set.TimeS(object.rows[k], i)) / set.fingers;
      if (std::isnan(mean)) continue;
      for (double& t : times) t -= mean;
      of_pose[object.number[k] % poses_per_round].push_back(std::move(times));
    }
    for (const auto& [pose, touches] : of_pose) {
      for (int i = 0; i < set.fingers; ++i) {
        double sum = 0, square = 0;
        for (const auto& times : touches) sum += times[i], square += times[i] * times[i];
        squares += square - sum * sum / touches.size();
      }
      scatter.degrees_of_freedom += (touches.size() - 1.0) * (set.fingers - 1);
    }
  }
  if (scatter.degrees_of_freedom > 0) scatter.sigma_s = std::sqrt(squares / scatter.degrees_of_freedom);
  return scatter;
}

touch::Plan WithPoses(const touch::Plan& plan, const AssumedPoses& poses) {
  touch::Plan changed = plan;
  changed.faces.max_tilt_rad = poses.max_tilt_rad;
  changed.faces.spread = poses.spread;
  return changed;
}

}  // namespace touchstone::diagnosis::distributions
