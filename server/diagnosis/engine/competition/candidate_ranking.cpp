#include "server/diagnosis/engine/competition/candidate_ranking.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "server/base/status.h"
#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"

namespace touchstone::diagnosis::engine {
namespace {

class Ranking {
 public:
  Ranking(const StepwiseSearch& search, const Fit& initial,
          const std::function<absl::Status(const Fit&, RankedCandidate*)>& set_errors)
      : search_(search), initial_(initial), set_errors_(set_errors) {}

  absl::Status Add(const Extension& extension) {
    if (extension.candidate < 0) return absl::OkStatus();
    const Candidate& from = search_.candidates()[extension.candidate];
    // The most probable place to start from stands for an effect.
    if (!listed_.insert({extension.name, from.per_object, extension.object}).second) return absl::OkStatus();
    const double gain_nats = extension.log_evidence - initial_.log_evidence;
    if (from.nameless) {
      if (extension.Acts()) all_.push_back(gain_nats);
      return absl::OkStatus();
    }
    // Of those that do not act on all objects alike only the likely ones: there are many.
    if (extension.rare && (fitted_on_one_ == kCompetitionRules.max_fitted_on_one || !extension.Acts()))
      return absl::OkStatus();
    RankedCandidate& candidate = ranked_.emplace_back();
    candidate.effect = extension.name;
    candidate.scope = from.per_object ? EffectScope::kObject : EffectScope::kRig;
    if (!extension.Acts()) {
      candidate.note = CandidateNote::kInvisible;
      return absl::OkStatus();
    }
    candidate.gain_nats = gain_nats;
    if (extension.rare || fitted_ < kCompetitionRules.max_fitted) {
      ++(extension.rare ? fitted_on_one_ : fitted_);
      TOUCHSTONE_RETURN_IF_ERROR(FitAlone(extension, &candidate));
    } else {
      candidate.note = CandidateNote::kLinearised;
    }
    if (candidate.explains()) all_.push_back(candidate.gain_nats);
    return absl::OkStatus();
  }

  std::vector<RankedCandidate> Finish() {
    for (RankedCandidate& candidate : ranked_)
      if (candidate.explains()) candidate.probability = ProbabilityAmong({candidate.gain_nats}, all_);
    std::stable_sort(ranked_.begin(), ranked_.end(), [](const RankedCandidate& a, const RankedCandidate& b) {
      return a.explains() != b.explains() ? a.explains() : a.gain_nats > b.gain_nats;
    });
    return std::move(ranked_);
  }

 private:
  absl::Status FitAlone(const Extension& extension, RankedCandidate* candidate) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Fit fit, search_.FitExtension(extension));
    candidate->gain_nats = fit.log_evidence - initial_.log_evidence;
    const int index = static_cast<int>(fit.model.base().effects.size()) - 1;
    if (ChangesNothing(fit, index)) {
      candidate->gain_nats = 0;
      candidate->note = CandidateNote::kNeutral;
      return absl::OkStatus();
    }
    if (IsAtBound(fit, index)) candidate->note = CandidateNote::kAtBound;
    candidate->parameters = fit.model.Describe(index, fit.point, fit.covariance);
    return set_errors_(fit, candidate);
  }

  const StepwiseSearch& search_;
  const Fit& initial_;
  const std::function<absl::Status(const Fit&, RankedCandidate*)>& set_errors_;
  std::set<std::tuple<std::string, bool, std::string>> listed_;
  std::vector<RankedCandidate> ranked_;
  std::vector<double> all_ = {0};  // log evidence: nothing is missing
  int fitted_ = 0, fitted_on_one_ = 0;
};

}  // namespace

absl::StatusOr<std::vector<RankedCandidate>> RankCandidates(
    const StepwiseSearch& search, const Fit& initial, int initial_effects,
    const std::function<absl::Status(const Fit&, RankedCandidate*)>& set_errors) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Extension> extensions, search.Score(initial, initial_effects));
  std::stable_sort(extensions.begin(), extensions.end(),
                   [](const Extension& a, const Extension& b) { return a.log_evidence > b.log_evidence; });
  Ranking ranking(search, initial, set_errors);
  for (const Extension& extension : extensions) TOUCHSTONE_RETURN_IF_ERROR(ranking.Add(extension));
  return ranking.Finish();
}

}  // namespace touchstone::diagnosis::engine
