#include "server/diagnosis/distributions/planned_touches.h"

#include <cmath>
#include <map>

#include "server/base/status.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/touch/batch_row.h"
#include "server/touch/simulate.h"

namespace touchstone::diagnosis::distributions {
namespace {

void Fill(const std::vector<touch::CommandedTouch>& touches, const std::vector<uint64_t>& numbers, size_t k,
          int t, effects::TouchBatch* batch) {
  touch::SetTouch(touches[k], numbers[k], t, batch);
  if (k > 0)
    batch->pause_s[t] = touch::PauseBetween(touches[k - 1].session_time_s, touches[k].session_time_s);
}

}  // namespace

absl::StatusOr<PlannedTouches> DrawPlannedTouches(std::shared_ptr<const model::Model> model,
                                                  std::shared_ptr<const geometry::Surface> surface,
                                                  const touch::Plan& plan,
                                                  const std::vector<uint64_t>& numbers, uint64_t seed) {
  const touch::TouchSimulator simulator(model);
  const auto generator = touch::MakePoseGenerator(plan, surface->bounds(), seed);
  const uint64_t poses_per_round = 6ull * plan.faces.samples_per_face;
  PlannedTouches drawn;
  drawn.numbers = numbers;
  drawn.seed = seed;
  for (const uint64_t number : numbers)
    drawn.touches.push_back(touch::TouchOfPlan(plan, *generator, number, 0));

  // The first touch of every pose decides whether the pose misses and is drawn again, in all of its rounds; a
  // finger that only failed to report does not count.
  std::map<uint64_t, uint32_t> attempt;
  std::vector<size_t> slots;
  for (size_t k = 0; k < numbers.size(); ++k)
    if (attempt.emplace(numbers[k] % poses_per_round, 0).second) slots.push_back(k);
  effects::TouchBatch batch;
  touch::TouchWorkspace workspace;
  batch.surface = surface;
  batch.seed = seed;
  for (uint32_t n = 0; n < kDistributionRules.max_attempts && !slots.empty(); ++n) {
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
      drawn.touches[slots[t]] =
          touch::TouchOfPlan(plan, *generator, number, ++attempt[number % poses_per_round]);
      missed.push_back(slots[t]);
    }
    slots.swap(missed);
  }
  for (size_t k = 0; k < numbers.size(); ++k) {
    const uint32_t draws = attempt[numbers[k] % poses_per_round];
    if (draws > 0) drawn.touches[k] = touch::TouchOfPlan(plan, *generator, numbers[k], draws);
  }
  return drawn;
}

absl::StatusOr<std::vector<double>> SimulatePlannedTouches(std::shared_ptr<const model::Model> model,
                                                           std::shared_ptr<const geometry::Surface> surface,
                                                           const PlannedTouches& drawn) {
  const touch::TouchSimulator simulator(model);
  const size_t count = drawn.touches.size();
  const int fingers = model->fingers;
  effects::TouchBatch batch;
  touch::TouchWorkspace workspace;
  batch.surface = std::move(surface);
  batch.seed = drawn.seed;
  // All together in the order of the session, so that a press reaches the next touch.
  const auto fill = [&] {
    simulator.Prepare(static_cast<int>(count), &batch);
    for (size_t k = 0; k < count; ++k) Fill(drawn.touches, drawn.numbers, k, static_cast<int>(k), &batch);
  };
  fill();
  if (simulator.needs_previous_press()) {
    TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
    std::vector<double> previous_press_m(count * fingers, 0.0);
    for (size_t k = 1; k < count; ++k)
      for (int i = 0; i < fingers; ++i)
        previous_press_m[batch.At(i, static_cast<int>(k))] =
            batch.press_m[batch.At(i, static_cast<int>(k) - 1)];
    fill();
    batch.previous_press_m = std::move(previous_press_m);
  }
  TOUCHSTONE_RETURN_IF_ERROR(simulator.Run(&batch, &workspace));
  std::vector<double> time_s(count * fingers, NAN);
  for (size_t k = 0; k < count; ++k)
    for (int i = 0; i < fingers; ++i)
      time_s[k * fingers + i] = batch.reported_time_s[batch.At(i, static_cast<int>(k))];
  return time_s;
}

absl::StatusOr<std::vector<double>> SimulatePlan(std::shared_ptr<const model::Model> model,
                                                 std::shared_ptr<const geometry::Surface> surface,
                                                 const touch::Plan& plan,
                                                 const std::vector<uint64_t>& numbers, uint64_t seed) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const PlannedTouches drawn,
                              DrawPlannedTouches(model, surface, plan, numbers, seed));
  return SimulatePlannedTouches(std::move(model), std::move(surface), drawn);
}

}  // namespace touchstone::diagnosis::distributions
