#include "server/diagnosis/images/photo_ladder.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/competition/candidate_ranking.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/images/photo_budget.h"
#include "server/diagnosis/images/rows/photo_covariates.h"
#include "server/diagnosis/images/rows/photo_rest_kinds.h"
#include "server/diagnosis/images/rows/photo_uneven_noise.h"
#include "server/diagnosis/images/terms/photo_formula.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kMisfitRows = 1.1;  // root mean square of rows, in noise, from which a rest counts
// Rows hardly count contours, which are point-sampled: an error so many times the floor is none of theirs.
constexpr double kMisfitPixels = 1.2;
constexpr double kRestP = 1e-4;
constexpr double kCurveGain = 0.01;  // of the mean square residual of pictures that a curve did not see
constexpr double kAlbedoNats = 5;
constexpr double kDoubted = 0.5;  // the most that a candidate is where no step was worth its entry
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
    engine::RoundValues(values_, &improved_);
    if (selection_.field >= 0) improved_.effects.erase(improved_.effects.begin() + selection_.field);
    TOUCHSTONE_RETURN_IF_ERROR(DescribeGiven());
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    changed_ |= !d_.steps.empty();
    NameAlbedo();
    if (changed_) {
      TOUCHSTONE_ASSIGN_OR_RETURN(*after_, ExpectPhotographs(photographs_, improved_, true, pool_));
    }
    const std::vector<image::Photo>& best = changed_ ? *after_ : before_;
    d_.noise_floor = NoiseFloorOfPhotographs(photographs_, best, pool_);
    d_.final = QualityOfPhotographs(photographs_, best, fit_.model.size(), pool_);
    d_.final->heldout_rmse *= selection_.heldout_ratio;
    d_.nothing_missing = engine::WorstOfKinds({&selection_.tried});
    for (engine::LadderStep& step : d_.steps) AssessByPixels(photographs_, d_.noise_floor, &step.quality);
    for (engine::Quality* quality : {&*d_.initial, &*d_.final})
      AssessByPixels(photographs_, d_.noise_floor, quality);
    const double floor2 = std::pow(d_.noise_floor.sigma, 2), initial2 = std::pow(d_.initial->rmse, 2);
    d_.reducible_share = initial2 > floor2 ? 1 - floor2 / initial2 : 0;
    TOUCHSTONE_ASSIGN_OR_RETURN(d_.uncertainty,
                                BudgetOfPhotographs(photographs_, values_, selection_.covariance, improved_,
                                                    d_.noise_floor.sigma, pool_));
    uncertainty::AddMisfit({d_.final->rmse, d_.noise_floor.sigma, d_.final->lack_of_fit_p}, 1,
                           &d_.uncertainty);
    const bool expectations_changed = changed_;
    AddPixelNoise(NoiseOfResiduals(photographs_, best, pool_), photographs_.set->photographs[0].channels,
                  *d_.final, &changed_, &improved_, &d_);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        d_.candidates,
        engine::RankCandidates(*selection_.fine.search, selection_.initial, selection_.initial_effects,
                               [this](const engine::Fit& fit, engine::RankedCandidate* candidate) {
                                 return SetErrors(fit, candidate);
                               }));
    TOUCHSTONE_RETURN_IF_ERROR(AssessRest());
    DoubtSteps();
    d_.verdict = d_.unexplained      ? engine::Verdict::kUnexplained
                 : !d_.steps.empty() ? engine::Verdict::kMissingEffects
                 : values_wrong_     ? engine::Verdict::kWrongValues
                                     : engine::Verdict::kAdequate;
    if (!expectations_changed) after_->clear();
    if (!changed_) return absl::OkStatus();
    if (!improved_.name.empty()) improved_.name += "_better";
    d_.improved_model = improved_;
    return absl::OkStatus();
  }

 private:
  // Values of the given model's effects that were set free: new ones, or zero as far as the data can tell.
  absl::Status DescribeGiven() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        engine::GivenEffects given,
        engine::DescribeGivenEffects(*selection_.fine.experiment, fit_, values_, selection_.covariance,
                                     *input_.model, photographs_.objects));
    for (const int index : given.superfluous) improved_.effects.erase(improved_.effects.begin() + index);
    values_wrong_ = given.changed();
    changed_ |= given.changed();
    d_.superfluous = std::move(given.superfluous_names);
    d_.refitted = std::move(given.refitted);
    return absl::OkStatus();
  }

  absl::Status DescribeSteps() {
    for (const PhotoRung& rung : selection_.rungs) {
      const auto step = std::find_if(selection_.steps.begin(), selection_.steps.end(),
                                     [&](const auto& other) { return other.effect == rung.effect; });
      if (step != selection_.steps.end())
        TOUCHSTONE_RETURN_IF_ERROR(DescribeStep(*step, rung.fit, rung.heldout_ratio));
    }
    return absl::OkStatus();
  }

  absl::Status DescribeStep(const engine::SelectedStep& from, const engine::Fit& with_it,
                            double heldout_ratio) {
    engine::LadderStep step = engine::DescribeStep(values_, selection_.covariance, from);
    engine::AddConfounded(step, &d_.confounded);
    step.model = with_it.model.base();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(photographs_, step.model, false, pool_));
    step.quality = QualityOfPhotographs(photographs_, expected, with_it.model.size(), pool_);
    step.quality.heldout_rmse *= heldout_ratio;
    d_.steps.push_back(std::move(step));
    return absl::OkStatus();
  }

  // The error of a candidate: what a comparison with it alone finds. On pictures that its fit did not see by linear steps,
  // since these are many.
  absl::Status SetErrors(const engine::Fit& fit, engine::RankedCandidate* candidate) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(photographs_, fit.model.base(), false, pool_));
    candidate->rmse = RmseGrey(photographs_, expected);
    candidate->heldout_rmse =
        std::sqrt(candidate->rmse * candidate->rmse +
                  HeldOutExcess(selection_.fine, fit, photographs_, d_.noise_floor.sigma));
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
    for (engine::LadderStep& step : d_.steps) {
      if (step.effect != kExposure) continue;
      const std::string decides = engine::DiscriminatingMeasurement({step.effect});
      if (step.discriminating_measurement.empty()) step.discriminating_measurement = decides;
      d_.confounded.push_back({{step.effect, kAlbedoOfAll}, decides});
    }
  }

  // What was not found good enough for a step is not probable, whatever it is compared with; nor is what leaves a rest.
  void DoubtSteps() {
    if (selection_.steps.empty())
      for (engine::RankedCandidate& candidate : d_.candidates)
        candidate.probability = std::min(candidate.probability, kDoubted);
    if (!d_.unexplained) return;
    const double explained = engine::ExplainedShare(d_.initial->rmse, d_.final->rmse, d_.noise_floor.sigma);
    engine::DoubtBesideRest(engine::MostBesideRest(explained, false), &d_.steps, &d_.candidates);
  }

  // A formula or a curve that says what is left.
  absl::Status AddSuggestion(engine::UnexplainedRest* rest) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::optional<RestSuggestion> found,
        SuggestForRest(photographs_, *selection_.photographs, improved_,
                       {rest->rmse, rest->heldout_rmse, d_.noise_floor.sigma}, pool_));
    if (!found) return absl::OkStatus();
    rest->model_with = found->with;
    rest->formula = found->formula;
    rest->formula_yaml = found->formula_yaml;
    rest->lookup_yaml = found->lookup_yaml;
    rest->rmse = found->rmse_grey;
    rest->heldout_rmse = found->heldout_rmse_grey;
    rest->heldout_gain = found->heldout_gain;
    std::stable_partition(rest->covariates.begin(), rest->covariates.end(),
                          [&](const auto& test) { return test.name == found->covariate; });
    return absl::OkStatus();
  }

  // A structure that no named effect explains.
  absl::Status AssessRest() {
    const engine::Likelihood& likelihood = *selection_.fine.likelihood;
    const double q = likelihood.Gram(likelihood.Prepare(fit_.columns.values.col(0)), fit_.hypothesis)(0, 0);
    const double freedom = std::max(selection_.fine.rows->rows() - fit_.model.size(), 1);
    const double p = ChiSquaredTail(q, freedom);
    d_.final->lack_of_fit_p = std::min(d_.final->lack_of_fit_p, p);
    const bool misfit = (p < kRestP && std::sqrt(q / freedom) > kMisfitRows) ||
                        d_.final->rmse > kMisfitPixels * d_.noise_floor.sigma;
    // What the improved model leaves, expected with the noise that it leaves.
    const Photographs& judged = *selection_.photographs;
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(judged, improved_, true, pool_));
    const std::vector<KindOfRest> kinds = KindsOfRest(judged, expected, pool_);
    const bool albedo = fit_.hypothesis != 0 && selection_.albedo_nats > kAlbedoNats &&
                        ShareOf(RestKind::kOnObjects, kinds) > 0;
    engine::UnexplainedRest rest;
    for (const PhotoCovariate& c : TestCovariates(judged, expected))
      if (c.p < kRestP && c.unseen_gain > kCurveGain) rest.covariates.push_back({c.name, c.p, c.gain_nats});
    // Noise that differs from part to part is no misfit of the means, and has the first word only where there is none.
    const bool of_means = misfit || albedo || !rest.covariates.empty() || selection_.field >= 0;
    const std::optional<UnevenNoise> uneven = FindUnevenNoise(judged, expected, pool_);
    if (!of_means && !uneven) return absl::OkStatus();
    rest.rmse = d_.final->rmse;
    rest.heldout_rmse = d_.final->heldout_rmse;
    if (of_means) TOUCHSTONE_RETURN_IF_ERROR(AddSuggestion(&rest));
    if (of_means) DescribeKind(kinds, uneven.has_value(), &rest);
    if (uneven) {
      rest.covariates.push_back(uneven->test);
      absl::StrAppend(&rest.words, rest.words.empty() ? "" : " ", uneven->words);
    }
    d_.unexplained = std::move(rest);
    return absl::OkStatus();
  }

  // The kind of the rest, unless a formula or a curve says more of it, or noise may be all of it.
  void DescribeKind(const std::vector<KindOfRest>& kinds, bool uneven, engine::UnexplainedRest* rest) const {
    if (!kinds.empty() && kinds[0].share > rest->heldout_gain) {
      rest->words = kinds[0].words;
      return;
    }
    if (uneven || !kinds.empty() || !rest->covariates.empty() || !rest->formula.empty() ||
        !rest->lookup_yaml.empty())
      return;
    rest->words =
        "Pictures differ from what is expected by more than their pixels scatter. Nothing in the catalogue "
        "explains it, and it depends on none of what was tried: places in the picture and on the objects, "
        "brightness and place of each picture, contours, grey level, incidence, depth, time.";
  }

  const DiagnosisInput& input_;
  ThreadPool* pool_;
  const Photographs& photographs_;
  const PhotoSelection& selection_;
  const engine::Fit& fit_;     // that was selected
  const engine::Fit& values_;  // the same effects, on every photograph
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
