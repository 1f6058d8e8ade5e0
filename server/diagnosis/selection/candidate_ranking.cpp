// Every effect of the catalogue as the only cause.
#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/inference/held_out.h"
#include "server/diagnosis/selection/ladder.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kMaxFitted = 8;       // candidates that are fitted in full
constexpr int kMaxFittedOnOne = 3;  // ... of those that do not act on all objects alike

// Whether every value of the effect ended at its neutral, usually a bound.
bool ChangesNothing(const inference::Fit& fit, int index) {
  for (int i = 0; i < fit.model.size(); ++i) {
    const inference::FreeParameter& c = fit.model.parameters()[i];
    if (c.effect == index && std::abs(fit.point[i] - c.neutral) > 1e-9 * c.scale) return false;
  }
  return true;
}

void DescribeFit(const inference::Experiment& experiment, const inference::Fit& fit,
                 double initial_log_evidence, RankedCandidate* candidate) {
  candidate->gain_nats = fit.log_evidence - initial_log_evidence;
  const int index = static_cast<int>(fit.model.base().effects.size()) - 1;
  if (ChangesNothing(fit, index)) {
    candidate->gain_nats = 0;
    candidate->note = CandidateNote::kNeutral;
    return;
  }
  candidate->parameters = fit.model.Describe(index, fit.point, fit.covariance);
  const Eigen::VectorXd r = fit.columns.values.col(0);
  candidate->rmse_s = std::sqrt(r.squaredNorm() / std::max<double>(1, static_cast<double>(r.size())));
  candidate->heldout_rmse_s = inference::HeldOutRmse(experiment, fit);
}

}  // namespace

absl::StatusOr<std::vector<RankedCandidate>> RankCandidates(const Workspace& workspace,
                                                            const SelectionResult& selection) {
  const StepwiseSearch& search = *selection.search;
  const inference::Fit& initial = selection.initial_model;
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Extension> extensions,
                              search.Score(initial, selection.initial_effects));
  std::stable_sort(extensions.begin(), extensions.end(),
                   [](const Extension& a, const Extension& b) { return a.log_evidence > b.log_evidence; });
  std::vector<RankedCandidate> candidates;
  std::vector<double> all = {0};  // log evidence: nothing is missing
  int fitted = 0, fitted_on_one = 0;
  for (const Extension& extension : extensions) {
    // Of those that do not act on all objects alike only the likely ones: there are many.
    const bool one = extension.rare;
    if (extension.candidate < 0 || (one && (fitted_on_one == kMaxFittedOnOne || !extension.visible)))
      continue;
    RankedCandidate& candidate = candidates.emplace_back();
    candidate.effect = extension.name;
    candidate.scope =
        search.candidates()[extension.candidate].per_object ? EffectScope::kObject : EffectScope::kRig;
    if (!extension.visible) {
      candidate.note = CandidateNote::kInvisible;
      continue;
    }
    candidate.gain_nats = extension.log_evidence - initial.log_evidence;
    if (one || fitted < kMaxFitted) {
      ++(one ? fitted_on_one : fitted);
      TOUCHSTONE_ASSIGN_OR_RETURN(const inference::Fit fit, search.FitExtension(extension));
      DescribeFit(workspace.experiment, fit, initial.log_evidence, &candidate);
    } else {
      candidate.note = CandidateNote::kLinearised;
    }
    if (candidate.explains()) all.push_back(candidate.gain_nats);
  }
  for (RankedCandidate& candidate : candidates)
    if (candidate.explains())
      candidate.probability = ProbabilityOfShare(candidate.gain_nats - inference::LogSum(all));
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const RankedCandidate& a, const RankedCandidate& b) {
                     return a.explains() != b.explains() ? a.explains() : a.gain_nats > b.gain_nats;
                   });
  return candidates;
}

}  // namespace touchstone::diagnosis::selection
