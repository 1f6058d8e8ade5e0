#include "server/diagnosis/distributions/pose_free.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/rules.h"

namespace touchstone::diagnosis::distributions {
namespace {

// Shares of the work that are done before each part of it.
constexpr double kBeforeFit = 0.1, kBeforeRank = 0.2, kBeforeEffects = 0.5, kBeforeRenewal = 0.8145;

// The effects that would make the model's sets like the measured one.
absl::StatusOr<std::vector<CompatibleEffect>> CompatibleEffects(const PoseFreeExperiment& experiment,
                                                                const PoseFreeRank& rank) {
  const auto misfit_under = [&](PoseFreeNull null) -> MisfitOfModel {
    return [&experiment, null = std::move(null)](const std::shared_ptr<const model::Model>& model,
                                                 const AssumedPoses& poses,
                                                 ReferenceSize size) -> absl::StatusOr<PoseFreeMisfit> {
      TOUCHSTONE_ASSIGN_OR_RETURN(const PoseFreeSamples reference,
                                  experiment.MakeReference(model, poses, size));
      const std::vector<double> distances = PoseFreeDistances(experiment.measured, reference);
      return PoseFreeMisfit{null.Misfit(distances), null.P(distances)};
    };
  };
  const auto renew = [&](const std::shared_ptr<const model::Model>& model,
                         const AssumedPoses& poses) -> absl::StatusOr<MisfitOfModel> {
    TOUCHSTONE_ASSIGN_OR_RETURN(const PoseFreeRank own, PoseFreeRank::Make(experiment, model, poses, true,
                                                                           kBeforeRenewal, kBeforeRenewal));
    return misfit_under(own.Null(experiment.objects.size()));
  };
  // Poses that were fitted to a model that lacks an effect may be far from the right ones.
  const AssumedPoses wide{kDistributionRules.wide_tilt_deg * kRadiansPerDegree,
                          kDistributionRules.wide_spread.value()};
  const std::vector<AssumedPoses> poses = {AssumedPoses(), wide, rank.poses()};
  return FindCompatibleEffects(
      *experiment.model, experiment.noise_is_known(), experiment.input.also, poses,
      misfit_under(rank.Null(experiment.objects.size())), renew, experiment.context.pool, [&](double done) {
        return experiment.Progress("trying effects", kBeforeEffects + (1 - kBeforeEffects) * done);
      });
}

// The comparison without its test.
PoseFreeComparison Prepare(const PoseFreeExperiment& experiment) {
  PoseFreeComparison comparison;
  comparison.rows = CountRows(experiment);
  comparison.noise_is_known = experiment.noise_is_known();
  comparison.noise = NoiseOfRounds(experiment);
  comparison.model = experiment.model;
  comparison.noise_change = experiment.noise_is_new    ? NoiseChange::kNewEffect
                            : experiment.noise_changed ? NoiseChange::kNewValue
                                                       : NoiseChange::kNone;
  comparison.model_has_noise = std::any_of(
      experiment.model->effects.begin(), experiment.model->effects.end(),
      [](const model::EffectInstance& e) { return e.effect->role == model::EffectRole::kNoiseLevel; });
  comparison.size_ratio = experiment.size_ratio;
  return comparison;
}

void DescribeTest(const PoseFreeExperiment& experiment, const PoseFreeRank& rank, bool poses_fitted,
                  PoseFreeComparison* comparison) {
  comparison->p_value = rank.p();
  comparison->compatible = rank.p() > kDistributionRules.small_p;
  comparison->energy_distance_s = rank.distances()[0];
  comparison->energy_p_value = rank.Null(experiment.objects.size()).P(0, rank.distances()[0]);
  comparison->statistics = CompareStatistics(experiment, rank);
  comparison->histograms = ComparePoseFreeHistograms(experiment, rank);
  comparison->plan = PlanInWords(experiment, rank.poses(), poses_fitted);
  for (const PoseFreeSample& sample : rank.reference()) comparison->simulated_touches += sample.points.size();
}

}  // namespace

absl::StatusOr<PoseFreeComparison> ComparePoseFree(const DiagnosisInput& input,
                                                   const DiagnosisContext& context, bool diagnose) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto made, PoseFreeExperiment::Create(input, context));
  const PoseFreeExperiment& experiment = *made;
  PoseFreeComparison comparison = Prepare(experiment);
  if (comparison.rows.compared == 0)
    return absl::InvalidArgumentError(
        absl::StrCat(experiment.set.origin,
                     ": no touch has a time of every finger; without poses there is nothing to compare"));

  TOUCHSTONE_ASSIGN_OR_RETURN(PoseFreeRank rank, PoseFreeRank::Make(experiment, experiment.model,
                                                                    AssumedPoses(), true, 0, kBeforeFit));
  const bool fitted = rank.p() <= kDistributionRules.suspicious_p;
  if (fitted) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const AssumedPoses poses,
                                FitPoses(experiment, rank, kBeforeFit, kBeforeRank));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        rank, PoseFreeRank::Make(experiment, experiment.model, poses, false, kBeforeRank, kBeforeEffects));
  }
  DescribeTest(experiment, rank, fitted, &comparison);
  comparison.diagnosed = diagnose;
  if (diagnose) comparison.findings = FindInRounds(experiment);
  if (diagnose && !comparison.compatible) {
    TOUCHSTONE_ASSIGN_OR_RETURN(comparison.compatible_effects, CompatibleEffects(experiment, rank));
  }
  experiment.Progress("done", 1);
  return comparison;
}

}  // namespace touchstone::diagnosis::distributions
