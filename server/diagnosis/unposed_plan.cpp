#include "server/diagnosis/unposed_plan.h"

#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/base/status.h"
#include "server/diagnosis/two_samples.h"
#include "server/touch/simulate.h"

namespace touchstone {
namespace {

constexpr int kMostRepeats = 60;
constexpr int kMostForNeighbours = 600;  // touches whose neighbours are looked up
constexpr double kSamePlace = 0.2;       // distance of repeats over that of any two touches, at most
constexpr double kGap = 3;               // the first stranger is so much farther than the last repeat
constexpr uint32_t kMostAttempts = 64;
constexpr double kTouchIntervalS = 10;

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

}  // namespace

int CountRepeats(const std::vector<double>& time_s, int fingers, bool* in_rounds) {
  const int count = static_cast<int>(time_s.size()) / fingers;
  *in_rounds = false;
  if (count < 4) return 1;

  // What any two touches are apart.
  RandomStream random(0, RandomDomain::kDiagnosis, 0, 6);
  std::vector<double> apart;
  for (int n = 0; n < 1000; ++n) {
    const int a = static_cast<int>(random.Below(count)), b = static_cast<int>(random.Below(count));
    if (a != b) PushIfNumber(Distance(time_s, fingers, a, b), &apart);
  }
  const double far = Median(apart);

  // Rounds: a constant number of rows later the same touch comes again. The shortest period counts.
  for (int repeats = std::min(kMostRepeats, count / 2); repeats >= 2; --repeats) {
    if (count % repeats != 0) continue;
    const int period = count / repeats;
    std::vector<double> again;
    const int step = std::max(1, (count - period) / 2000);
    for (int n = 0; n + period < count; n += step)
      PushIfNumber(Distance(time_s, fingers, n, n + period), &again);
    if (Median(again) < kSamePlace * far) {
      *in_rounds = true;
      return repeats;
    }
  }

  // In any order: everybody has repeats - 1 neighbours much closer than the next.
  const int looked_up = std::min(count, kMostForNeighbours), most = std::min(kMostRepeats, count - 1);
  std::vector<std::vector<double>> nearest(most);
  for (int n = 0; n < looked_up; ++n) {
    std::vector<double> distances;
    const int mine = static_cast<int>(int64_t{n} * count / looked_up);
    for (int other = 0; other < count; ++other)
      if (other != mine) PushIfNumber(Distance(time_s, fingers, mine, other), &distances);
    if (static_cast<int>(distances.size()) < most) continue;
    std::partial_sort(distances.begin(), distances.begin() + most, distances.end());
    for (int r = 0; r < most; ++r) nearest[r].push_back(distances[r]);
  }
  if (nearest[0].empty()) return 1;
  int repeats = 1;
  double widest = kGap;
  for (int r = 0; r + 1 < most; ++r) {
    const double here = Median(nearest[r]), next = Median(nearest[r + 1]);
    if (here < kSamePlace * far && next > widest * here) repeats = r + 2, widest = next / here;
  }
  return repeats;
}

UnposedObject SupposePlan(const MeasurementSet& set, int object, std::shared_ptr<const Surface> surface,
                          double speed_m_s, int most_touches) {
  UnposedObject result;
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
  result.plan.kind = Plan::Kind::kFaces;
  result.plan.speed_m_s = speed_m_s;
  result.plan.touch_interval_s = kTouchIntervalS;
  result.plan.faces.samples_per_face = (poses + 5) / 6;
  result.plan.faces.rounds = result.repeats;

  // Row n was the plan's touch n, unless a round of the plan has a few poses more than a round of the set.
  // Large sets are thinned by whole poses, evenly: so every face keeps its part.
  const int kept = std::max(1, std::min(poses, most_touches / result.repeats));
  const uint64_t poses_a_round = 6ull * result.plan.faces.samples_per_face;
  for (int n = 0; n < count; ++n) {
    const int64_t pose = n % poses;
    const int64_t slot =
        (pose * kept + poses - 1) / poses;  // the pose of this slot, if it is the slot's first
    if (slot >= kept || slot * poses / kept != pose) continue;
    result.rows.push_back(rows[n]);
    result.number.push_back(pose + poses_a_round * (n / poses));
  }
  return result;
}

double ScatterAmongRounds(const MeasurementSet& set, const std::vector<UnposedObject>& objects,
                          double* degrees) {
  double squares = 0;
  *degrees = 0;
  for (const UnposedObject& object : objects) {
    if (!object.in_rounds) continue;
    const uint64_t poses_a_round = 6ull * object.plan.faces.samples_per_face;
    std::map<uint64_t, std::vector<std::vector<double>>> of_pose;
    for (size_t k = 0; k < object.rows.size(); ++k) {
      std::vector<double> times(set.fingers);
      double mean = 0;
      for (int i = 0; i < set.fingers; ++i) mean += (times[i] = set.TimeS(object.rows[k], i)) / set.fingers;
      if (std::isnan(mean)) continue;
      for (double& t : times) t -= mean;
      of_pose[object.number[k] % poses_a_round].push_back(std::move(times));
    }
    for (const auto& [pose, touches] : of_pose) {
      for (int i = 0; i < set.fingers; ++i) {
        double sum = 0, square = 0;
        for (const auto& times : touches) sum += times[i], square += times[i] * times[i];
        squares += square - sum * sum / touches.size();
      }
      *degrees += (touches.size() - 1.0) * (set.fingers - 1);
    }
  }
  return *degrees > 0 ? std::sqrt(squares / *degrees) : 0;
}

absl::StatusOr<std::vector<double>> SimulateUnposed(std::shared_ptr<const Model> model,
                                                    std::shared_ptr<const Surface> surface, const Plan& plan,
                                                    const std::vector<uint64_t>& numbers, uint64_t seed) {
  const TouchSimulator simulator(model);
  const auto generator = MakePoseGenerator(plan, surface->bounds(), seed);
  const int fingers = model->fingers;
  const uint64_t poses_a_round = 6ull * plan.faces.samples_per_face;
  std::vector<double> time_s(numbers.size() * fingers, NAN);

  // A pose that misses is drawn again, in all of its rounds; a finger that only failed to report is not.
  std::map<uint64_t, uint32_t> attempt;
  std::vector<uint32_t> slots(numbers.size());
  for (size_t k = 0; k < slots.size(); ++k) slots[k] = static_cast<uint32_t>(k);
  TouchBatch batch;
  TouchWorkspace workspace;
  batch.surface = surface;
  batch.seed = seed;
  const auto fill = [&](size_t k, int t) {
    const uint64_t number = numbers[k];
    const auto found = attempt.find(number % poses_a_round);
    const CommandedTouch touch =
        TouchOfPlan(plan, *generator, number, found == attempt.end() ? 0 : found->second);
    batch.index[t] = number;
    batch.target_m[t] = touch.target_m;
    batch.approach[t] = touch.approach;
    batch.lateral[t] = touch.lateral;
    batch.standoff_m[t] = touch.standoff_m;
    batch.speed_m_s[t] = touch.speed_m_s;
    batch.session_time_s[t] = touch.session_time_s;
  };
  for (uint32_t n = 0; n < kMostAttempts; ++n) {
    simulator.Prepare(static_cast<int>(slots.size()), &batch);
    for (size_t t = 0; t < slots.size(); ++t) fill(slots[t], static_cast<int>(t));
    TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
    std::vector<uint32_t> missed;
    std::map<uint64_t, bool> missed_pose;
    for (size_t t = 0; t < slots.size(); ++t)
      for (int i = 0; i < fingers; ++i)
        if (std::isnan(batch.travel_m[batch.At(i, static_cast<int>(t))]))
          missed_pose[numbers[slots[t]] % poses_a_round] = true;
    if (missed_pose.empty() && n == 0) break;
    for (const auto& [pose, yes] : missed_pose) ++attempt[pose];
    for (const uint32_t slot : slots)
      if (missed_pose.count(numbers[slot] % poses_a_round)) missed.push_back(slot);
    slots.swap(missed);
    if (slots.empty()) break;
  }

  // All together in the order of the session, so that a press reaches the next touch.
  simulator.Prepare(static_cast<int>(numbers.size()), &batch);
  for (size_t k = 0; k < numbers.size(); ++k) fill(k, static_cast<int>(k));
  TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
  for (size_t k = 1; k < numbers.size(); ++k)
    for (int i = 0; i < fingers; ++i) {
      const double press_m = batch.press_m[batch.At(i, static_cast<int>(k) - 1)];
      batch.previous_press_m[batch.At(i, static_cast<int>(k))] = std::isnan(press_m) ? 0 : press_m;
    }
  TOUCHSTONE_RETURN_IF_ERROR(simulator.RunSensor(&batch, &workspace));
  for (size_t k = 0; k < numbers.size(); ++k)
    for (int i = 0; i < fingers; ++i)
      time_s[k * fingers + i] = batch.reported_time_s[batch.At(i, static_cast<int>(k))];
  return time_s;
}

}  // namespace touchstone
