#include "server/diagnosis/engine/findings.h"

#include "server/base/status.h"
#include "server/diagnosis/engine/competition/candidate_ranking.h"
#include "server/diagnosis/engine/ladder/step_order.h"
#include "server/diagnosis/engine/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

// Of any kind of measurement.
const std::vector<HypothesisRule>& RulesOfAnyKind() {
  static const auto& rules = *new std::vector<HypothesisRule>{{0, "misfit", Leaves::kMeans, {}}};
  return rules;
}

class Finder {
 public:
  Finder(const Modality& modality, double noise)
      : modality_(modality),
        noise_(noise),
        experiment_(modality.experiment()),
        search_(experiment_, modality.candidates(), SearchRules(), [](const std::string&) {}),
        whole_{modality.alone(), static_cast<int>(modality.given().effects.size())} {}

  absl::StatusOr<Findings> Run() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Quality initial, modality_.Compare(modality_.given()));
    for (;;) {
      found_ = Findings();
      found_.initial = initial;
      TOUCHSTONE_ASSIGN_OR_RETURN(const int without_gain, Climb());
      if (without_gain < 0) break;
      TOUCHSTONE_ASSIGN_OR_RETURN(whole_.fit, FitModel(experiment_, whole_.fit.model.Without(without_gain)));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(found_.final, QualityOf(found_.improved, whole_.fit, values_));
    if (KeepGivenIfWorse(modality_.given(), initial, found_.final, &found_)) found_.final = initial;
    TOUCHSTONE_RETURN_IF_ERROR(Rank());
    Hypotheses hypotheses(RulesOfAnyKind());
    if (StructureRemains(found_.final, noise_)) hypotheses.Add(0);
    Conclude(hypotheses, ExplainedShare(initial.rmse, found_.final.rmse, noise_), &found_);
    return std::move(found_);
  }

 private:
  // Values, steps and their errors of the explanation as it stands. Returns StepOrder::without_gain.
  absl::StatusOr<int> Climb() {
    TOUCHSTONE_ASSIGN_OR_RETURN(const FinalRows rows, modality_.RowsNear(whole_.fit));
    values_ = whole_.fit;
    if (rows.owner != nullptr) {
      TOUCHSTONE_ASSIGN_OR_RETURN(values_, FitModel(rows.experiment, whole_.fit.model));
    }
    const Eigen::MatrixXd covariance = modality_.CovarianceOf(rows.experiment, values_);
    TOUCHSTONE_RETURN_IF_ERROR(ImproveValues(experiment_, whole_.fit, values_, covariance, modality_.given(),
                                             modality_.objects(), &found_)
                                   .status());
    return DescribeSteps(covariance);
  }

  absl::StatusOr<Quality> QualityOf(const model::Model& model, const Fit& searched, const Fit& final) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(Quality quality, modality_.Compare(model));
    TOUCHSTONE_ASSIGN_OR_RETURN(const HeldOutError heldout, modality_.HeldOut(searched, final));
    quality.heldout_rmse = heldout.Of(quality.rmse);
    return quality;
  }

  absl::StatusOr<int> DescribeSteps(const Eigen::MatrixXd& covariance) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<SelectedStep> selected,
                                FindCompetitors(search_, whole_, -1, {}));
    TOUCHSTONE_ASSIGN_OR_RETURN(const StepOrder order,
                                OrderSteps(experiment_, whole_, -1, selected, found_.initial,
                                           [this](const OrderedStep& next, const Quality&) {
                                             return QualityOf(ModelWith(next), next.fit,
                                                              next.whole ? values_ : next.fit);
                                           }));
    for (const OrderedStep& next : order.steps)
      AddStep(values_, covariance, *next.step, ModelWith(next), next.quality, &found_);
    return order.without_gain;
  }

  const model::Model& ModelWith(const OrderedStep& step) const {
    return step.whole ? found_.improved : step.fit.model.base();
  }

  absl::Status Rank() {
    const Parameterization given(modality_.given(), modality_.objects());
    TOUCHSTONE_ASSIGN_OR_RETURN(const Fit initial, FitModel(experiment_, given));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        found_.candidates, RankCandidates(search_, initial, whole_.initial_effects,
                                          [this](const Fit& fit, RankedCandidate* candidate) -> absl::Status {
                                            TOUCHSTONE_ASSIGN_OR_RETURN(
                                                const Quality quality, QualityOf(fit.model.base(), fit, fit));
                                            candidate->rmse = quality.rmse;
                                            candidate->heldout_rmse = quality.heldout_rmse;
                                            return absl::OkStatus();
                                          }));
    return absl::OkStatus();
  }

  const Modality& modality_;
  const double noise_;
  const Experiment& experiment_;
  const StepwiseSearch search_;
  Explanation whole_;
  Fit values_;
  Findings found_;
};

}  // namespace

absl::StatusOr<Findings> FindMissing(const Modality& modality, double noise) {
  return Finder(modality, noise).Run();
}

bool StructureRemains(const Quality& quality, double noise) {
  return quality.lack_of_fit_p < kEngineRules.unexplained_p &&
         quality.rmse > (1 + kEngineRules.unexplained_share) * noise;
}

}  // namespace touchstone::diagnosis::engine
