#include "server/diagnosis/images/photo_ladder.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/competition/candidate_ranking.h"
#include "server/diagnosis/images/photo_budget.h"
#include "server/diagnosis/images/photo_hypotheses.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/rows/photo_covariates.h"
#include "server/diagnosis/images/rows/photo_rest_kinds.h"
#include "server/diagnosis/images/rows/photo_uneven_noise.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/search/rules.h"
#include "server/diagnosis/images/terms/photo_formula.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr char kUnknownInWords[] =
    "Pictures differ from what is expected by more than their pixels scatter. Nothing in the catalogue "
    "explains it, "
    "and none of what was tried takes as much as 15 % of it: places in the picture and on the objects, "
    "brightness and place of each picture, contours, grey level, incidence, depth, time.";
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
        after_(after),
        found_(selection.found) {}

  absl::Status Run() {
    TOUCHSTONE_RETURN_IF_ERROR(engine::ImproveValues(*selection_.fine.experiment, fit_, values_,
                                                     selection_.covariance, *input_.model,
                                                     photographs_.objects, &d_)
                                   .status());
    d_.improved = WithoutImageField(std::move(d_.improved));
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    NameAlbedo();
    const bool expectations_changed = d_.changed;
    if (expectations_changed) {
      TOUCHSTONE_ASSIGN_OR_RETURN(*after_, ExpectPhotographs(photographs_, d_.improved, true, pool_));
    }
    const std::vector<image::Photo>& best = expectations_changed ? *after_ : before_;
    d_.noise_floor = NoiseFloorOfPhotographs(photographs_, best, pool_);
    d_.final = QualityOfPhotographs(photographs_, best, fit_.model.size(), pool_);
    d_.final->heldout_rmse *= selection_.heldout_ratio;
    d_.nothing_missing = engine::WorstOfKinds({&selection_.tried});
    for (engine::LadderStep& step : d_.steps) AssessByPixels(photographs_, d_.noise_floor, &step.quality);
    for (engine::Quality* quality : {&*d_.initial, &*d_.final})
      AssessByPixels(photographs_, d_.noise_floor, quality);
    TOUCHSTONE_ASSIGN_OR_RETURN(d_.uncertainty,
                                BudgetOfPhotographs(photographs_, values_, selection_.covariance, d_.improved,
                                                    d_.noise_floor.sigma, pool_));
    uncertainty::AddMisfit({d_.final->rmse, d_.noise_floor.sigma, d_.final->lack_of_fit_p}, 1,
                           &d_.uncertainty);
    AddPixelNoise(NoiseOfResiduals(photographs_, best, pool_), photographs_.set->photographs[0].channels,
                  *d_.final, &d_);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        d_.candidates,
        engine::RankCandidates(*selection_.fine.search, selection_.initial, selection_.initial_effects,
                               [this](const engine::Fit& fit, engine::RankedCandidate* candidate) {
                                 return SetErrors(fit, candidate);
                               }));
    TOUCHSTONE_RETURN_IF_ERROR(AssessRest());
    // What was not found good enough for a step is not probable, whatever it is compared with.
    if (selection_.steps.empty())
      for (engine::RankedCandidate& candidate : d_.candidates)
        candidate.probability = std::min(candidate.probability, kImageRules.max_doubted.value());
    if (d_.unexplained && d_.nothing_missing)
      d_.nothing_missing = engine::WithRest(*d_.nothing_missing, *d_.unexplained);
    engine::Conclude(found_, engine::ExplainedShare(d_.initial->rmse, d_.final->rmse, d_.noise_floor.sigma),
                     &d_);
    if (!expectations_changed) after_->clear();
    return absl::OkStatus();
  }

 private:
  using P = PhotoHypothesis;

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
    const model::Model& model = with_it.model.base();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(photographs_, model, false, pool_));
    engine::Quality quality = QualityOfPhotographs(photographs_, expected, with_it.model.size(), pool_);
    quality.heldout_rmse *= heldout_ratio;
    engine::AddStep(values_, selection_.covariance, from, model, quality, &d_);
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
    const image::PhotoSimulator simulator(std::make_shared<const model::Model>(d_.improved));
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

  // What is left by the table of hypotheses: of the improved model, expected with the noise that it leaves.
  absl::Status AssessRest() {
    const Photographs& judged = *selection_.photographs;
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(judged, d_.improved, true, pool_));
    const std::vector<KindOfRest> kinds = KindsOfRest(judged, expected, pool_);
    engine::UnexplainedRest rest;
    TOUCHSTONE_RETURN_IF_ERROR(found_.Ask(
        {{P::kMisfit, [&] { return found_.AddIf(HasMisfit(), P::kMisfit); }},
         {P::kAlbedo,
          [&] {
            return found_.AddIf(fit_.hypothesis != 0 && selection_.albedo_nats > kImageRules.albedo_nats &&
                                    ShareOf(RestKind::kOnObjects, kinds) > 0,
                                P::kAlbedo);
          }},
         {P::kDependence, [&] { return AskDependence(TestCovariates(judged, expected)); }},
         {P::kImageField, [&] { return found_.AddIf(selection_.field >= 0, P::kImageField); }},
         {P::kSuggestion, [&] { return AskSuggestion(&rest); }},
         {P::kKindOfRest,
          [&] {
            const bool said = IsOfMeans() && !kinds.empty() && kinds[0].share > rest.heldout_gain;
            return found_.AddIf(said, P::kKindOfRest, said ? InWords(kinds[0]) : "");
          }},
         {P::kUnevenNoise, [&] { return AskUnevenNoise(FindUnevenNoise(judged, expected, pool_)); }},
         {P::kUnknown, [&] { return found_.AddIf(IsOfMeans(), P::kUnknown, kUnknownInWords); }}}));
    if (!found_.Leave(engine::Leaves::kBeside)) return absl::OkStatus();
    found_.DescribeRest(&rest);
    d_.unexplained = std::move(rest);
    return absl::OkStatus();
  }

  bool IsOfMeans() const { return found_.Leave(engine::Leaves::kMeans); }

  bool HasMisfit() {
    const RowsMisfit misfit = MisfitOfRows(selection_.fine, fit_);
    d_.final->lack_of_fit_p = std::min(d_.final->lack_of_fit_p, misfit.p);
    return (misfit.p < kImageRules.rest_p && misfit.in_noise > kPhotoSearchRules.misfit_rows) ||
           d_.final->rmse > kImageRules.clear_misfit * d_.noise_floor.sigma;
  }

  absl::Status AskDependence(const std::vector<PhotoCovariate>& covariates) {
    std::vector<engine::CovariateTest> tests;
    for (const PhotoCovariate& c : covariates)
      if (c.p < kImageRules.rest_p && c.unseen_gain > kImageRules.curve_gain)
        tests.push_back({c.name, c.p, c.gain_nats});
    return found_.AddIf(!tests.empty(), P::kDependence, "",
                        [tests](engine::UnexplainedRest* rest) { rest->covariates = tests; });
  }

  // A formula or a curve that says what is left of the means, with the errors that it leaves.
  absl::Status AskSuggestion(engine::UnexplainedRest* rest) {
    rest->rmse = d_.final->rmse;
    rest->heldout_rmse = d_.final->heldout_rmse;
    if (!IsOfMeans()) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::optional<RestSuggestion> found,
        SuggestForRest(photographs_, *selection_.photographs, d_.improved,
                       {rest->rmse, rest->heldout_rmse, d_.noise_floor.sigma}, pool_));
    if (!found) return absl::OkStatus();
    *rest = *found;
    return found_.AddIf(true, P::kSuggestion, "", [first = found->follows](engine::UnexplainedRest* of) {
      const auto is_first = [&](const auto& test) { return test.name == first.name; };
      if (!first.name.empty() && std::none_of(of->covariates.begin(), of->covariates.end(), is_first))
        of->covariates.push_back(first);
      std::stable_partition(of->covariates.begin(), of->covariates.end(), is_first);
    });
  }

  absl::Status AskUnevenNoise(const std::optional<UnevenNoise>& uneven) {
    if (!uneven) return absl::OkStatus();
    return found_.AddIf(
        true, P::kUnevenNoise, uneven->words,
        [test = uneven->test](engine::UnexplainedRest* rest) { rest->covariates.push_back(test); });
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
  engine::Hypotheses found_;
};

}  // namespace

absl::Status DescribeExplanation(const DiagnosisInput& input, const DiagnosisContext& context,
                                 const Photographs& photographs, const PhotoSelection& selection,
                                 const std::vector<image::Photo>& before, PhotographDiagnosis* diagnosis,
                                 std::vector<image::Photo>* after) {
  return PhotoLadder(input, context, photographs, selection, before, diagnosis, after).Run();
}

}  // namespace touchstone::diagnosis::images
