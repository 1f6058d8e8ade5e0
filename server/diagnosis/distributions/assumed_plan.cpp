#include "server/diagnosis/distributions/assumed_plan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/random.h"
#include "server/base/status.h"
#include "server/diagnosis/distributions/two_samples.h"
#include "server/touch/simulate.h"

namespace touchstone {
namespace {

constexpr int kMaxRepeats = 60;
constexpr int kMaxForNeighbours = 600;  // touches whose neighbours are looked up
constexpr double kSamePlace = 0.2;      // distance of repeats over that of any two touches, at most
constexpr double kGap = 3;              // the first stranger is so much farther than the last repeat
constexpr uint32_t kMaxAttempts = 64;
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
  for (int repeats = std::min(kMaxRepeats, count / 2); repeats >= 2; --repeats) {
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
  const int looked_up = std::min(count, kMaxForNeighbours), most = std::min(kMaxRepeats, count - 1);
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
                          double speed_m_s, int max_touches) {
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
  const int kept = std::max(1, std::min(poses, max_touches / result.repeats));
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

namespace {

void Fill(const std::vector<CommandedTouch>& touches, const std::vector<uint64_t>& numbers, size_t k, int t,
          TouchBatch* batch) {
  const CommandedTouch& touch = touches[k];
  batch->index[t] = numbers[k];
  batch->target_m[t] = touch.target_m;
  batch->approach[t] = touch.approach;
  batch->lateral[t] = touch.lateral;
  batch->standoff_m[t] = touch.standoff_m;
  batch->speed_m_s[t] = touch.speed_m_s;
  batch->session_time_s[t] = touch.session_time_s;
}

}  // namespace

Plan WithPoses(const Plan& plan, const SupposedPoses& poses) {
  Plan changed = plan;
  changed.faces.max_tilt_rad = poses.max_tilt_rad;
  changed.faces.spread = poses.spread;
  return changed;
}

absl::StatusOr<UnposedTouches> DrawUnposed(std::shared_ptr<const Model> model,
                                           std::shared_ptr<const Surface> surface, const Plan& plan,
                                           const std::vector<uint64_t>& numbers, uint64_t seed) {
  const TouchSimulator simulator(model);
  const auto generator = MakePoseGenerator(plan, surface->bounds(), seed);
  const uint64_t poses_a_round = 6ull * plan.faces.samples_per_face;
  UnposedTouches drawn;
  drawn.numbers = numbers;
  drawn.seed = seed;
  for (const uint64_t number : numbers) drawn.touches.push_back(TouchOfPlan(plan, *generator, number, 0));

  // The first touch of every pose tells whether the pose misses and is drawn again, in all of its rounds; a
  // finger that only failed to report does not count.
  std::map<uint64_t, uint32_t> attempt;
  std::vector<size_t> slots;
  for (size_t k = 0; k < numbers.size(); ++k)
    if (attempt.emplace(numbers[k] % poses_a_round, 0).second) slots.push_back(k);
  TouchBatch batch;
  TouchWorkspace workspace;
  batch.surface = surface;
  batch.seed = seed;
  for (uint32_t n = 0; n < kMaxAttempts && !slots.empty(); ++n) {
    simulator.Prepare(static_cast<int>(slots.size()), &batch);
    for (size_t t = 0; t < slots.size(); ++t)
      Fill(drawn.touches, numbers, slots[t], static_cast<int>(t), &batch);
    TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
    std::vector<size_t> missed;
    for (size_t t = 0; t < slots.size(); ++t) {
      bool hit = true;
      for (int i = 0; i < model->fingers; ++i)
        hit &= !std::isnan(batch.travel_m[batch.At(i, static_cast<int>(t))]);
      if (hit) continue;
      const uint64_t number = numbers[slots[t]];
      drawn.touches[slots[t]] = TouchOfPlan(plan, *generator, number, ++attempt[number % poses_a_round]);
      missed.push_back(slots[t]);
    }
    slots.swap(missed);
  }
  for (size_t k = 0; k < numbers.size(); ++k) {
    const uint32_t draws = attempt[numbers[k] % poses_a_round];
    if (draws > 0) drawn.touches[k] = TouchOfPlan(plan, *generator, numbers[k], draws);
  }
  return drawn;
}

absl::StatusOr<std::vector<double>> PlayUnposed(std::shared_ptr<const Model> model,
                                                std::shared_ptr<const Surface> surface,
                                                const UnposedTouches& drawn) {
  const TouchSimulator simulator(model);
  const size_t count = drawn.touches.size();
  const int fingers = model->fingers;
  TouchBatch batch;
  TouchWorkspace workspace;
  batch.surface = std::move(surface);
  batch.seed = drawn.seed;
  // All together in the order of the session, so that a press reaches the next touch.
  simulator.Prepare(static_cast<int>(count), &batch);
  for (size_t k = 0; k < count; ++k) Fill(drawn.touches, drawn.numbers, k, static_cast<int>(k), &batch);
  TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
  for (size_t k = 1; k < count; ++k)
    for (int i = 0; i < fingers; ++i) {
      const double press_m = batch.press_m[batch.At(i, static_cast<int>(k) - 1)];
      batch.previous_press_m[batch.At(i, static_cast<int>(k))] = std::isnan(press_m) ? 0 : press_m;
    }
  TOUCHSTONE_RETURN_IF_ERROR(simulator.RunSensor(&batch, &workspace));
  std::vector<double> time_s(count * fingers, NAN);
  for (size_t k = 0; k < count; ++k)
    for (int i = 0; i < fingers; ++i)
      time_s[k * fingers + i] = batch.reported_time_s[batch.At(i, static_cast<int>(k))];
  return time_s;
}

absl::StatusOr<std::vector<double>> SimulateUnposed(std::shared_ptr<const Model> model,
                                                    std::shared_ptr<const Surface> surface, const Plan& plan,
                                                    const std::vector<uint64_t>& numbers, uint64_t seed) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const UnposedTouches drawn, DrawUnposed(model, surface, plan, numbers, seed));
  return PlayUnposed(std::move(model), std::move(surface), drawn);
}

}  // namespace touchstone
