#include "server/diagnosis/distributions/pose_free_rank.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/distributions/rules.h"

namespace touchstone::diagnosis::distributions {
namespace {

constexpr int kPortion = 8;  // sets between two reports of progress

}  // namespace

double SequentialP(const std::vector<double>& simulated, double measured, int k) {
  int as_large = 0;
  for (size_t n = 0; n < simulated.size(); ++n) {
    as_large += simulated[n] >= measured - 1e-12;
    if (as_large == k) return double(k) / (n + 1);
  }
  return (1.0 + as_large) / (1.0 + simulated.size());
}

PoseFreeNull PoseFreeRank::Null(size_t object) const {
  std::vector<std::vector<double>> distances;
  for (const auto& set : sets_) distances.push_back(set[object]);
  return PoseFreeNull(std::move(distances));
}

absl::StatusOr<PoseFreeRank> PoseFreeRank::Make(const PoseFreeExperiment& experiment,
                                                const std::shared_ptr<const model::Model>& model,
                                                const AssumedPoses& poses, bool coarse, double from,
                                                double to) {
  PoseFreeRank rank;
  rank.poses_ = poses;
  TOUCHSTONE_ASSIGN_OR_RETURN(rank.reference_, experiment.MakeReference(model, poses, ReferenceSize::kFull));
  rank.distances_ = PoseFreeDistances(experiment.measured, rank.reference_);

  const size_t objects = experiment.objects.size();
  const int first_sets = kDistributionRules.first_sets, some_sets = kDistributionRules.some_sets,
            small_p_sets = kDistributionRules.small_p_sets, all_sets = kDistributionRules.all_sets;
  const int max_sets = coarse ? some_sets : all_sets;
  std::vector<absl::Status> status(max_sets);
  const auto make = [&](int begin, int end) {
    for (int n = begin; n < end; ++n) {
      const auto set = experiment.MakeSet(model, poses, n);
      if (!set.ok()) {
        status[n] = set.status();
        continue;
      }
      for (size_t o = 0; o < objects; ++o)
        rank.sets_[n].push_back(PoseFreeDistances((*set)[o], rank.reference_[o]));
      rank.sets_[n].push_back(PoseFreeDistances(*set, rank.reference_));
    }
  };
  for (const int until : {first_sets, some_sets, small_p_sets, all_sets}) {
    if (until > max_sets) break;
    for (int begin = static_cast<int>(rank.sets_.size()); begin < until; begin += kPortion) {
      if (!experiment.Progress("simulating sets", from + (to - from) * begin / max_sets))
        return absl::CancelledError("cancelled");
      const int end = std::min(until, begin + kPortion);
      rank.sets_.resize(end);
      if (experiment.context.pool)
        experiment.context.pool->ParallelFor(end - begin, 1,
                                             [&](int a, int b) { make(begin + a, begin + b); });
      else
        make(begin, end);
      for (int n = begin; n < end; ++n) TOUCHSTONE_RETURN_IF_ERROR(status[n]);
    }
    const PoseFreeNull null = rank.Null(objects);
    std::vector<double> simulated;
    for (const auto& set : rank.sets_) simulated.push_back(null.LargestStandardised(set[objects]));
    const double measured = null.LargestStandardised(rank.distances_);
    const auto as_large = std::count_if(simulated.begin(), simulated.end(),
                                        [&](double value) { return value >= measured - 1e-12; });
    rank.p_ = SequentialP(simulated, measured, kDistributionRules.enough_sets);
    if (as_large >= kDistributionRules.enough_sets) break;
    if (coarse && rank.p_ <= kDistributionRules.suspicious_p) break;
    if (until == small_p_sets && as_large == 0) break;
  }
  return rank;
}

absl::StatusOr<AssumedPoses> FitPoses(const PoseFreeExperiment& experiment, const PoseFreeRank& rank,
                                      double from, double to) {
  const PoseFreeNull null = rank.Null(experiment.objects.size());
  AssumedPoses best;
  double best_misfit = HUGE_VAL;
  int tried = 0;
  const auto attempt = [&](double tilt_deg, double spread, ReferenceSize size) -> absl::Status {
    if (!experiment.Progress("fitting the poses' spread", from + (to - from) * tried++ / 33))
      return absl::CancelledError("cancelled");
    const AssumedPoses poses{tilt_deg * kRadiansPerDegree, spread};
    TOUCHSTONE_ASSIGN_OR_RETURN(const PoseFreeSamples reference,
                                experiment.MakeReference(experiment.model, poses, size));
    const double misfit = null.Misfit(PoseFreeDistances(experiment.measured, reference));
    if (misfit < best_misfit) best_misfit = misfit, best = poses;
    return absl::OkStatus();
  };
  for (const double tilt_deg : {5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0})
    for (const double spread : {0.4, 0.6, 0.8})
      TOUCHSTONE_RETURN_IF_ERROR(attempt(tilt_deg, spread, ReferenceSize::kQuick));
  const AssumedPoses coarse = best;
  // Never worse than the poses that are assumed by default.
  best = rank.poses();
  best_misfit = null.Misfit(rank.distances());
  for (const double tilt_deg : {-2.5, 0.0, 2.5})
    for (const double spread : {-0.1, 0.0, 0.1})
      TOUCHSTONE_RETURN_IF_ERROR(attempt(coarse.max_tilt_rad / kRadiansPerDegree + tilt_deg,
                                         coarse.spread + spread, ReferenceSize::kFull));
  return best;
}

}  // namespace touchstone::diagnosis::distributions
