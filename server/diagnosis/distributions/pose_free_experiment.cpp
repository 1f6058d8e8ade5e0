#include "server/diagnosis/distributions/pose_free_experiment.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::distributions {
namespace {

constexpr uint64_t kReferenceSeed = 1;  // sets are 2, 3, ...

}  // namespace

absl::StatusOr<std::unique_ptr<PoseFreeExperiment>> PoseFreeExperiment::Create(
    const DiagnosisInput& input, const DiagnosisContext& context) {
  std::unique_ptr<PoseFreeExperiment> made(new PoseFreeExperiment(input, context));
  TOUCHSTONE_RETURN_IF_ERROR(made->Prepare());
  return made;
}

absl::Status PoseFreeExperiment::Prepare() {
  if (set.size() == 0) return absl::InvalidArgumentError(absl::StrCat(set.origin, ": holds no touch"));
  if (set.fingers != input.model->fingers)
    return absl::InvalidArgumentError(absl::StrCat(set.origin, ": has times of ", set.fingers,
                                                   " fingers, the model '", input.model->name, "' has ",
                                                   input.model->fingers, ": they must agree"));
  if (set.fingers < 2)
    return absl::InvalidArgumentError(
        absl::StrCat(set.origin, ": one finger alone has no relative times, there is nothing to compare"));
  if (set.speed_m_s.size() == static_cast<size_t>(set.size())) {
    std::vector<double> speeds = set.speed_m_s;
    std::nth_element(speeds.begin(), speeds.begin() + speeds.size() / 2, speeds.end());
    speed_m_s = speeds[speeds.size() / 2];
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckMeshes(input, set.origin, set.objects));
  const int count = static_cast<int>(set.objects.size());
  for (int o = 0; o < count; ++o) {
    const auto surface = input.surfaces.find(set.objects[o]);
    objects.push_back(AssumePlan(set, o, surface->second, speed_m_s,
                                 std::max(24, kDistributionRules.max_measured_touches / count)));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CompareSizes());
  if (size_ratio == 1) EstimateNoise();
  for (int o = 0; o < count; ++o)
    measured.push_back(MakePoseFreeSample(MeasuredTimes(o), set.fingers, speed_m_s, model->spacing_m));
  return absl::OkStatus();
}

// Times that no speed could give are in another unit than they should be; noise must not make up for that.
absl::Status PoseFreeExperiment::CompareSizes() {
  double here = 0, simulated = 0;
  for (size_t o = 0; o < objects.size(); ++o) {
    const auto spread = [&](const std::vector<double>& time_s) {
      return TouchStatistics(time_s, set.fingers, speed_m_s, model->spacing_m)[0].Mean();
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> time_s,
                                TimesOfSet(model, static_cast<int>(o), AssumedPoses(), kReferenceSeed));
    here += spread(MeasuredTimes(static_cast<int>(o)));
    simulated += spread(time_s);
  }
  if (simulated > 0 && (here > 100 * simulated || here < 0.01 * simulated)) size_ratio = here / simulated;
  return absl::OkStatus();
}

// The scatter among repeats of a pose can be measured without knowing the pose.
void PoseFreeExperiment::EstimateNoise() {
  scatter = ScatterAmongRounds(set, objects);
  if (!noise_is_known() || scatter.sigma_s == 0) return;
  auto noisy = std::make_shared<model::Model>(*input.model);
  for (model::EffectInstance& instance : noisy->effects) {
    if (instance.effect->role != model::EffectRole::kNoiseLevel) continue;
    const double sigma_s = instance.ValuesFor(set.objects[0])[0];
    const double std_error_s = scatter.sigma_s / std::sqrt(2 * scatter.degrees_of_freedom);
    if (std::abs(scatter.sigma_s - sigma_s) < kDistributionRules.min_noise_change * std_error_s) return;
    instance.values[0] = scatter.sigma_s;
    instance.object_values.clear();
    noise_changed = true;
    noise_is_new = sigma_s == 0;
    model = noisy;
    return;
  }
  model::EffectInstance noise;
  noise.effect = effects::FindByRole(model::EffectRole::kNoiseLevel);
  noise.values = {scatter.sigma_s};
  noisy->effects.push_back(std::move(noise));
  noise_changed = noise_is_new = true;
  model = noisy;
}

std::vector<double> PoseFreeExperiment::MeasuredTimes(int object) const {
  std::vector<double> time_s;
  for (const int row : objects[object].rows)
    for (int i = 0; i < set.fingers; ++i) time_s.push_back(set.TimeS(row, i));
  return time_s;
}
absl::StatusOr<std::vector<double>> PoseFreeExperiment::TimesOfSet(
    const std::shared_ptr<const model::Model>& of, int object, const AssumedPoses& poses,
    uint64_t number) const {
  const PoseFreeObject& like = objects[object];
  // Every object of every set has poses of its own.
  const uint64_t seed = RandomBlock(input.seed, RandomDomain::kDiagnosis, number, object, 7)[0];
  return SimulatePlan(of, like.surface, WithPoses(like.plan, poses), like.number, seed);
}

// The poses are those that the given model (with its noise) reaches, whatever model then simulates them, so
// that the distances of two models differ because of the models alone.
absl::StatusOr<std::shared_ptr<const PlannedTouches>> PoseFreeExperiment::TouchesOfReference(
    int object, const AssumedPoses& poses, ReferenceSize size) const {
  const auto key = std::make_tuple(object, poses.max_tilt_rad, poses.spread, size);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = touches_.find(key);
    if (found != touches_.end()) return found->second;
  }
  const bool quick = size == ReferenceSize::kQuick;
  const int max_touches = quick ? kDistributionRules.max_quick_per_object.value()
                                : kDistributionRules.max_reference_per_object.value(),
            all_touches = quick ? kDistributionRules.quick_touches.value()
                                : kDistributionRules.reference_touches.value();
  touch::Plan plan = WithPoses(objects[object].plan, poses);
  plan.faces.rounds = 1;
  plan.faces.samples_per_face =
      std::clamp(all_touches / 6 / static_cast<int>(set.objects.size()), 10, max_touches / 6);
  std::vector<uint64_t> numbers(6 * plan.faces.samples_per_face);
  for (size_t n = 0; n < numbers.size(); ++n) numbers[n] = n;
  const uint64_t seed = RandomBlock(input.seed, RandomDomain::kDiagnosis, kReferenceSeed, object, 7)[0];
  TOUCHSTONE_ASSIGN_OR_RETURN(PlannedTouches touches,
                              DrawPlannedTouches(model, objects[object].surface, plan, numbers, seed));
  auto shared = std::make_shared<const PlannedTouches>(std::move(touches));
  const std::lock_guard<std::mutex> lock(mutex_);
  return touches_.emplace(key, shared).first->second;
}

absl::StatusOr<PoseFreeSamples> PoseFreeExperiment::MakeReference(
    const std::shared_ptr<const model::Model>& of, const AssumedPoses& poses, ReferenceSize size) const {
  PoseFreeSamples samples;
  for (size_t o = 0; o < objects.size(); ++o) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto touches, TouchesOfReference(static_cast<int>(o), poses, size));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> time_s,
                                SimulatePlannedTouches(of, objects[o].surface, *touches));
    samples.push_back(MakePoseFreeSample(time_s, set.fingers, speed_m_s, of->spacing_m));
  }
  return samples;
}

absl::StatusOr<PoseFreeSamples> PoseFreeExperiment::MakeSet(const std::shared_ptr<const model::Model>& of,
                                                            const AssumedPoses& poses,
                                                            uint64_t number) const {
  PoseFreeSamples samples;
  for (size_t o = 0; o < objects.size(); ++o) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> time_s,
                                TimesOfSet(of, static_cast<int>(o), poses, kReferenceSeed + 1 + number));
    // A finger that reported nothing in the set does so here.
    const std::vector<double> reported = MeasuredTimes(static_cast<int>(o));
    for (size_t t = 0; t < time_s.size(); ++t)
      if (std::isnan(reported[t])) time_s[t] = NAN;
    samples.push_back(MakePoseFreeSample(time_s, set.fingers, speed_m_s, of->spacing_m));
  }
  return samples;
}

}  // namespace touchstone::diagnosis::distributions
