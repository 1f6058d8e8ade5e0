#include "server/diagnosis/images/photo_ladder.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/images/photo_candidates.h"
#include "server/diagnosis/images/photo_covariates.h"
#include "server/diagnosis/images/photo_formula.h"
#include "server/diagnosis/selection/ladder.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kMisfitRows = 1.1;  // root mean square of rows, in noise, from which a rest counts
// Rows hardly count contours, which are point-sampled: an error so many times the floor is none of theirs.
constexpr double kMisfitPixels = 1.2;
constexpr double kRestP = 1e-4;
constexpr double kCurveGain = 0.01;  // of the mean square residual of pictures that a curve did not see
constexpr double kAlbedoNats = 5;
constexpr double kDoubted = 0.5, kMaxBesideRest = 0.9;
constexpr double kZeroWithinErrors = 2;
constexpr char kExposure[] = "exposure", kAlbedoOfAll[] = "the albedo of all objects";

class PhotoLadder {
 public:
  PhotoLadder(const DiagnosisInput& input, const DiagnosisContext& context, const Photographs& photographs,
              const PhotoSelection& selection, const std::vector<image::Photo>& before,
              PhotographDiagnosis* diagnosis, std::vector<image::Photo>* after)
      : input_(input),
        pool_(context.pool),
        photographs_(photographs),
        selection_(selection),
        fit_(selection.fit),
        values_(selection.polished),
        before_(before),
        d_(*diagnosis),
        after_(after) {}

  absl::Status Run() {
    improved_ = values_.model.base();
    selection::RoundValues(values_, &improved_);
    if (selection_.field >= 0) improved_.effects.erase(improved_.effects.begin() + selection_.field);
    TOUCHSTONE_RETURN_IF_ERROR(DescribeGivenEffects());
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    changed_ |= !d_.steps.empty();
    NameAlbedo();
    if (changed_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(*after_, ExpectPhotographs(photographs_, improved_, true, pool_));
    }
    const std::vector<image::Photo>& best = changed_ ? *after_ : before_;
    d_.noise_floor = NoiseFloorOfPhotographs(photographs_, best, pool_);
    d_.final = QualityOfPhotographs(photographs_, best, fit_.model.size(), pool_);
    d_.final->heldout_rmse_grey *= selection_.heldout_ratio;
    for (PhotographStep& step : d_.steps) JudgeByPixels(photographs_, d_.noise_floor, &step.quality);
    for (GreyQuality* quality : {&*d_.initial, &*d_.final})
      JudgeByPixels(photographs_, d_.noise_floor, quality);
    const double floor2 = std::pow(d_.noise_floor.sigma_grey, 2),
                 initial2 = std::pow(d_.initial->rmse_grey, 2);
    d_.reducible_share = initial2 > floor2 ? 1 - floor2 / initial2 : 0;
    const bool expectations_changed = changed_;
    AddPixelNoise(NoiseOfResiduals(photographs_, best, pool_), photographs_.set->photographs[0].channels,
                  *d_.final, &changed_, &improved_, &d_);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        d_.candidates, RankPhotoCandidates(photographs_, selection_, d_.noise_floor.sigma_grey, pool_));
    JudgeRest();
    DoubtCandidates();
    d_.verdict = d_.unexplained      ? selection::Verdict::kUnexplained
                 : !d_.steps.empty() ? selection::Verdict::kMissingEffects
                 : values_wrong_     ? selection::Verdict::kWrongValues
                                     : selection::Verdict::kAdequate;
    if (!expectations_changed) after_->clear();
    if (!changed_) return absl::OkStatus();
    if (!improved_.name.empty()) improved_.name += "_better";
    d_.improved_model = improved_;
    return absl::OkStatus();
  }

 private:
  // Values of the model's own effects that were set free: new ones, or nothing at all.
  absl::Status DescribeGivenEffects() {
    const model::Model& before = *input_.model;
    const inference::Parameterization initial(before, photographs_.objects);
    for (int index = static_cast<int>(before.effects.size()) - 1; index >= 0; --index) {
      if (!fit_.model.IsFree(index)) continue;
      const model::Effect& effect = *before.effects[index].effect;
      selection::RefittedEffect refit{inference::NameOf(effect),
                                      values_.model.Describe(index, values_.point, selection_.covariance)};
      const auto old = initial.Describe(index, Eigen::VectorXd(), Eigen::MatrixXd());
      bool zero = true;
      for (size_t j = 0; j < refit.parameters.size(); ++j) {
        inference::ParameterEstimate& e = refit.parameters[j];
        if (j < old.size()) e.before = old[j].value;
        for (const model::ParameterInfo& parameter : effect.parameters)
          if (parameter.name == e.name)
            zero &= std::abs(e.value - parameter.neutral) <=
                    std::max(kZeroWithinErrors * e.std_error, 1e-6 * parameter.typical);
      }
      values_wrong_ = changed_ = true;
      if (zero) {
        d_.superfluous.push_back(refit.effect);
        improved_.effects.erase(improved_.effects.begin() + index);
      } else {
        d_.refitted.insert(d_.refitted.begin(), std::move(refit));
      }
    }
    return absl::OkStatus();
  }

  // Steps in the order in which they explain most: each is fitted with those before it.
  absl::Status DescribeSteps() {
    const inference::Experiment& experiment = *selection_.fine.experiment;
    std::vector<const selection::SelectedStep*> open;
    for (const selection::SelectedStep& step : selection_.steps) open.push_back(&step);
    std::vector<int> kept;
    while (!open.empty()) {
      absl::StatusOr<inference::Fit> next = absl::NotFoundError("");
      size_t chosen = 0;
      for (size_t j = 0; j < open.size(); ++j) {
        std::vector<int> with = kept;
        with.push_back(open[j]->effect);
        TOUCHSTONE_ASSIGN_OR_RETURN(inference::Fit trial, inference::FitModel(experiment, Only(with)));
        if (next.ok() && trial.log_evidence <= next->log_evidence) continue;
        next = std::move(trial);
        chosen = j;
      }
      kept.push_back(open[chosen]->effect);
      // The last step is the whole explanation.
      const bool last = open.size() == 1 && selection_.field < 0;
      double heldout_ratio = selection_.heldout_ratio;
      if (!last) {
        TOUCHSTONE_ASSIGN_OR_RETURN(
            heldout_ratio, HeldOutRatio(*selection_.photographs, *selection_.fine.rows, experiment, *next));
      }
      TOUCHSTONE_RETURN_IF_ERROR(DescribeStep(*open[chosen], last ? values_ : *next, heldout_ratio));
      open.erase(open.begin() + static_cast<long>(chosen));
    }
    return absl::OkStatus();
  }

  // The explanation with only these of its steps.
  inference::Parameterization Only(const std::vector<int>& kept) const {
    inference::Parameterization part = fit_.model;
    for (int index = static_cast<int>(part.base().effects.size()) - 1; index >= selection_.initial_effects;
         --index)
      if (std::find(kept.begin(), kept.end(), index) == kept.end()) part = part.Without(index);
    return part;
  }

  absl::Status DescribeStep(const selection::SelectedStep& from, const inference::Fit& with_it,
                            double heldout_ratio) {
    const model::EffectInstance& instance = fit_.model.base().effects[from.effect];
    PhotographStep step;
    step.effect = inference::NameOf(*instance.effect);
    step.scope = instance.per_object ? selection::EffectScope::kObject : selection::EffectScope::kRig;
    step.meaning = instance.effect->meaning;
    step.check_on_rig = instance.effect->check_on_rig;
    step.remedy = instance.effect->remedy;
    step.probability = from.probability;
    step.gain_nats = from.gain_nats;
    step.parameters = values_.model.Describe(from.effect, values_.point, selection_.covariance);
    if (const std::string only = fit_.model.OnlyObject(from.effect); !only.empty())
      step.words = absl::StrCat("on ", only, " only");
    std::vector<std::string> names = {step.effect};
    for (const selection::CompetingEffect& other : from.competing)
      if (other.equivalent && std::find(names.begin(), names.end(), other.name) == names.end())
        names.push_back(other.name);
    step.equivalent.assign(names.begin() + 1, names.end());
    if (!step.equivalent.empty()) {
      step.discriminating_measurement = selection::DiscriminatingMeasurement(names);
      d_.confounded.push_back({names, step.discriminating_measurement});
    }
    step.model = with_it.model.base();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(photographs_, step.model, false, pool_));
    step.quality = QualityOfPhotographs(photographs_, expected, with_it.model.size(), pool_);
    step.quality.heldout_rmse_grey *= heldout_ratio;
    d_.steps.push_back(std::move(step));
    return absl::OkStatus();
  }

  // Surfaces that all reflect another share of the light look like another exposure, unless the ground behind them is
  // lit or they shine, since neither comes from their albedo: the catalogue has no such effect, and no fit can tell.
  void NameAlbedo() {
    const image::PhotoSimulator simulator(std::make_shared<const model::Model>(improved_));
    for (const std::string& object : photographs_.objects) {
      const effects::PhotoSettings settings = simulator.SettingsFor(object);
      if (settings.background_light > 0 || settings.specular_strength > 0) return;
    }
    for (PhotographStep& step : d_.steps) {
      if (step.effect != kExposure) continue;
      const std::string decides = selection::DiscriminatingMeasurement({step.effect});
      if (step.discriminating_measurement.empty()) step.discriminating_measurement = decides;
      d_.confounded.push_back({{step.effect, kAlbedoOfAll}, decides});
    }
  }

  // On what the improved model leaves, expected with the noise that it leaves.
  std::vector<PhotoCovariate> CovariatesOf(const model::Model& model) const {
    const auto expected = ExpectPhotographs(*selection_.photographs, model, true, pool_);
    return expected.ok() ? TestCovariates(*selection_.photographs, *expected) : std::vector<PhotoCovariate>();
  }

  // The most that a step can be sure of beside a rest that remains.
  double MostBesideRest() const {
    const double floor2 = std::pow(d_.noise_floor.sigma_grey, 2);
    const double before2 = std::pow(d_.initial->rmse_grey, 2) - floor2,
                 after2 = std::pow(d_.final->rmse_grey, 2) - floor2;
    const double explained = before2 > 0 ? std::clamp(1 - after2 / before2, 0.0, 1.0) : 0;
    return kDoubted + (kMaxBesideRest - kDoubted) * explained;
  }

  // What was not found good enough for a step, or leaves a rest, is not probable, whatever it is compared with.
  void DoubtCandidates() {
    double most = selection_.steps.empty() ? kDoubted : selection::kMaxProbability;
    if (d_.unexplained && !selection_.steps.empty()) most = MostBesideRest();
    for (RankedPhotographCandidate& candidate : d_.candidates)
      candidate.probability = std::min(candidate.probability, most);
  }

  // A formula or a curve that says what is left.
  void AddSuggestion(UnexplainedPhotographs* rest) const {
    const std::optional<RestSuggestion> found =
        SuggestForRest(photographs_, *selection_.photographs, improved_,
                       {rest->rmse_grey, rest->heldout_rmse_grey, d_.noise_floor.sigma_grey}, pool_);
    if (!found) return;
    rest->formula = found->formula;
    rest->formula_yaml = found->formula_yaml;
    rest->lookup_yaml = found->lookup_yaml;
    rest->rmse_grey = found->rmse_grey;
    rest->heldout_rmse_grey = found->heldout_rmse_grey;
    rest->heldout_gain = found->heldout_gain;
    std::stable_partition(rest->covariates.begin(), rest->covariates.end(),
                          [&](const auto& test) { return test.name == found->covariate; });
  }

  // A structure that no named effect explains.
  void JudgeRest() {
    const inference::Likelihood& likelihood = *selection_.fine.likelihood;
    const double q = likelihood.Gram(inference::Likelihood::Pick(fit_.columns, {0}), fit_.hypothesis)(0, 0);
    const double freedom = std::max(selection_.fine.rows->rows() - fit_.model.size(), 1);
    const double p = ChiSquaredTail(q, freedom);
    d_.final->lack_of_fit_p = std::min(d_.final->lack_of_fit_p, p);
    const bool misfit = (p < kRestP && std::sqrt(q / freedom) > kMisfitRows) ||
                        d_.final->rmse_grey > kMisfitPixels * d_.noise_floor.sigma_grey;
    const bool albedo = fit_.hypothesis != 0 && selection_.albedo_nats > kAlbedoNats;
    const std::vector<PhotoCovariate> curves = CovariatesOf(improved_);
    const bool curve = std::any_of(curves.begin(), curves.end(), [](const PhotoCovariate& c) {
      return c.p < kRestP && c.unseen_gain > kCurveGain;
    });
    if (!misfit && !albedo && !curve && selection_.field < 0) return;
    UnexplainedPhotographs rest;
    rest.rmse_grey = d_.final->rmse_grey;
    rest.heldout_rmse_grey = d_.final->heldout_rmse_grey;
    for (const PhotoCovariate& c : curves)
      if (c.p < kRestP && c.unseen_gain > kCurveGain) rest.covariates.push_back({c.name, c.p, c.gain_nats});
    AddSuggestion(&rest);
    // What a formula or a curve says as well is not said again.
    const bool said = !rest.formula.empty() || !rest.lookup_yaml.empty();
    if (selection_.field >= 0 && !said)
      absl::StrAppend(
          &rest.words,
          "Grey levels that are the same in every picture and smooth across it: dirt on the lens, a "
          "reflection, stray light. Photograph a plain white sheet.");
    if (albedo && !said)
      absl::StrAppend(
          &rest.words, rest.words.empty() ? "" : " ",
          "The light of the objects' surfaces differs by smooth patches that stay at their places: paint, "
          "dirt, or a shape that departs from its mesh.");
    if (misfit && rest.words.empty() && !said)
      rest.words =
          "Pictures differ from what is expected by more than their pixels scatter, and nothing in the "
          "catalogue "
          "explains it.";
    d_.unexplained = std::move(rest);
    for (PhotographStep& step : d_.steps) {
      step.probability = std::min(step.probability, MostBesideRest());
      absl::StrAppend(&step.words, step.words.empty() ? "" : " ",
                      "Beside it a rest remains unexplained: it may stand in for something else.");
    }
  }

  const DiagnosisInput& input_;
  ThreadPool* pool_;
  const Photographs& photographs_;
  const PhotoSelection& selection_;
  const inference::Fit& fit_;     // that was selected
  const inference::Fit& values_;  // the same effects, on every photograph
  const std::vector<image::Photo>& before_;
  PhotographDiagnosis& d_;
  std::vector<image::Photo>* after_;
  model::Model improved_;
  bool changed_ = false, values_wrong_ = false;
};

}  // namespace

absl::Status DescribeExplanation(const DiagnosisInput& input, const DiagnosisContext& context,
                                 const Photographs& photographs, const PhotoSelection& selection,
                                 const std::vector<image::Photo>& before, PhotographDiagnosis* diagnosis,
                                 std::vector<image::Photo>* after) {
  return PhotoLadder(input, context, photographs, selection, before, diagnosis, after).Run();
}

}  // namespace touchstone::diagnosis::images
