#include "server/diagnosis/images/search/photo_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/effect_columns.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/search/photo_quality.h"
#include "server/diagnosis/images/search/rules.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::images {
namespace {

PhotoRowsOptions FarRows() {
  PhotoRowsOptions options;
  options.cells = kPhotoSearchRules.far_cells;
  options.smoothing = kPhotoSearchRules.far_smoothing;
  options.max_photographs = kPhotoSearchRules.coarse_photographs;
  options.max_trial_steps = kPhotoSearchRules.max_trial_steps;
  options.max_steps = kPhotoSearchRules.max_far_steps;
  return options;
}

PhotoRowsOptions CoarseRows() {
  PhotoRowsOptions options;
  options.cells = kPhotoSearchRules.coarse_cells;
  options.smoothing = kPhotoSearchRules.coarse_smoothing;
  options.max_photographs = kPhotoSearchRules.coarse_photographs;
  options.max_trial_steps = kPhotoSearchRules.max_trial_steps;
  return options;
}

// Whether the explanation moves rays by more than the initial model does.
bool MovesRaysBeyond(const engine::Explanation& explanation) {
  const std::vector<model::EffectInstance>& effects = explanation.fit.model.base().effects;
  return std::any_of(effects.begin() + explanation.initial_effects, effects.end(),
                     [](const model::EffectInstance& instance) { return MovesRays(*instance.effect); });
}

// Derivatives by what moves rays are the anchor's. A value that moved contours by several pixels away from it may have
// stopped where those derivatives no longer lead downwards: from there they are taken again, until nothing moves.
absl::Status MoveAnchor(const Photographs& photographs, const DiagnosisContext& context,
                        engine::Explanation* explanation) {
  if (!MovesRaysBeyond(*explanation)) return absl::OkStatus();
  for (int pass = 0; pass < kPhotoSearchRules.anchor_passes; ++pass) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const PhotoSearch there,
        MakePhotoSearch(photographs, explanation->fit.model.base(), {}, CoarseRows(), context));
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit fit, engine::FitModel(*there.experiment, explanation->fit.model));
    double farthest = 0;  // standard errors
    for (int i = 0; i < fit.model.size(); ++i)
      if (fit.covariance(i, i) > 0)
        farthest = std::max(
            farthest, std::abs(fit.point[i] - explanation->fit.point[i]) / std::sqrt(fit.covariance(i, i)));
    explanation->fit = std::move(fit);
    if (farthest < kPhotoSearchRules.anchor_stays) break;
  }
  return absl::OkStatus();
}

// What coarse cells say. Where it moves contours far, derivatives at the given model hide what else is missing: the search
// goes on at what it has found.
absl::StatusOr<engine::Explanation> ExplainCoarsely(const DiagnosisInput& input,
                                                    const Photographs& photographs,
                                                    const std::vector<engine::Candidate>& candidates,
                                                    const DiagnosisContext& context) {
  engine::Explanation explanation;
  explanation.initial_effects = static_cast<int>(input.model->effects.size());
  model::Model anchor = *input.model;
  const auto search = [&](const PhotoRowsOptions& options,
                          const std::vector<engine::Candidate>& of) -> absl::StatusOr<PhotoSearch> {
    absl::StatusOr<PhotoSearch> made = MakePhotoSearch(photographs, anchor, of, options, context);
    if (!made.ok()) return made;
    made->experiment->settled = input.settled;
    made->experiment->update_derivatives = true;
    return made;
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(PhotoSearch coarse, search(CoarseRows(), candidates));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      explanation.fit,
      engine::FitModel(*coarse.experiment, engine::Parameterization(*input.model, photographs.objects)));
  if (explanation.fit.sigma > kPhotoSearchRules.far_sigma) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const PhotoSearch far, search(FarRows(), NamedOfRig(candidates)));
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation found, far.search->Continue(explanation));
    TOUCHSTONE_RETURN_IF_ERROR(MoveAnchor(photographs, context, &found));
    if (MovesRaysBeyond(found) && found.fit.sigma < kPhotoSearchRules.far_leaves * explanation.fit.sigma) {
      explanation = std::move(found);
      anchor = explanation.fit.model.base();
      TOUCHSTONE_ASSIGN_OR_RETURN(coarse, search(CoarseRows(), candidates));
    }
  }
  for (int pass = 0; pass < kPhotoSearchRules.coarse_passes; ++pass) {
    const size_t had = explanation.fit.model.base().effects.size();
    if (pass > 0) {
      TOUCHSTONE_ASSIGN_OR_RETURN(coarse, search(CoarseRows(), candidates));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(explanation, coarse.search->Continue(explanation));
    TOUCHSTONE_RETURN_IF_ERROR(MoveAnchor(photographs, context, &explanation));
    anchor = explanation.fit.model.base();
    if (anchor.effects.size() == had || !MovesRaysBeyond(explanation)) break;
  }
  return explanation;
}

}  // namespace

absl::StatusOr<PhotoSearch> MakePhotoSearch(const Photographs& photographs, const model::Model& anchor,
                                            const std::vector<engine::Candidate>& candidates,
                                            const PhotoRowsOptions& options,
                                            const DiagnosisContext& context) {
  PhotoSearch made;
  std::vector<std::shared_ptr<const model::Effect>> effects;
  for (const engine::Candidate& candidate : candidates) effects.push_back(candidate.effect);
  TOUCHSTONE_ASSIGN_OR_RETURN(made.rows,
                              PhotoRows::Make(photographs, anchor, effects, options, context.pool));
  made.likelihood =
      std::make_unique<engine::Likelihood>(made.rows->GroupRows(), &made.rows->albedo(), 0, context.pool);
  made.likelihood->SetLeastNoise(1);
  made.experiment = std::make_unique<engine::Experiment>();
  made.experiment->observations = made.rows.get();
  made.experiment->likelihood = made.likelihood.get();
  made.experiment->pool = context.pool;
  engine::SearchRules rules;
  rules.cv_gain_over_noise = true;
  // A fit of photographs takes a second: where nothing explains them, fits of what might are most of a diagnosis.
  rules.max_refits = kPhotoSearchRules.max_refits;
  rules.max_rare_refits = kPhotoSearchRules.max_rare_refits;
  rules.min_declared_share = kPhotoSearchRules.min_declared_share;
  rules.rest_sigma = kPhotoSearchRules.rest_sigma, rules.rest_cv_gain = kPhotoSearchRules.rest_gain;
  rules.max_trial_steps = options.max_trial_steps;
  rules.max_steps = options.max_steps;
  made.search = std::make_unique<engine::StepwiseSearch>(*made.experiment, candidates, rules,
                                                         [](const std::string&) {});
  return made;
}

RowsMisfit MisfitOfRows(const PhotoSearch& search, const engine::Fit& fit) {
  const engine::Likelihood& likelihood = *search.likelihood;
  const double q = likelihood.Gram(likelihood.Prepare(fit.columns.values.col(0)), fit.hypothesis)(0, 0);
  const double freedom = std::max(search.rows->rows() - fit.model.size(), 1);
  return {std::sqrt(q / freedom), ChiSquaredTail(q, freedom),
          ChiSquaredTail(q / (kPhotoSearchRules.misfit_rows * kPhotoSearchRules.misfit_rows), freedom)};
}

namespace {

// That noise alone leaves what the given model does, of rows and of pixels. Whatever is drawn by turning pictures over leaves as
// much: of no draw is this asked.
absl::StatusOr<double> LackOfFitP(const Photographs& photographs, const PhotoSelection& selection,
                                  const model::Model& given, ThreadPool* pool) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(photographs, given, false, pool));
  engine::Quality pixels;
  pixels.rmse = RmseGrey(photographs, expected), pixels.lack_of_fit_p = 1;
  AssessByPixels(photographs, NoiseFloorOfPhotographs(photographs, expected, pool), &pixels);
  return std::min(
      1.0, 2 * std::min(pixels.lack_of_fit_p, MisfitOfRows(selection.fine, selection.initial).p_counts));
}

// Pictures are what is independent: the pixels of one share their errors.
absl::StatusOr<engine::TriedPValues> TryOnPictures(const Photographs& photographs,
                                                   const PhotoSelection& selection, const model::Model& given,
                                                   uint64_t seed, ThreadPool* pool) {
  const PhotoSearch& search = selection.fine;
  const PhotoRows& rows = *search.rows;
  std::vector<int> pictures;
  for (int row = 0; row < rows.rows(); ++row)
    if (row == 0 || rows.PhotographOfRow(row) != rows.PhotographOfRow(row - 1)) pictures.push_back(row);
  if (pictures.size() < kPhotoSearchRules.min_tried_pictures) return engine::TriedPValues();
  pictures.push_back(rows.rows());
  TOUCHSTONE_ASSIGN_OR_RETURN(const engine::GivenAndEffects tried,
                              engine::ColumnsOfEffects(*search.search, given));
  engine::LinearHypotheses hypotheses(0, pictures);
  hypotheses.AddEffects(rows, tried.effects);
  const Eigen::MatrixXd linear =
      hypotheses.PValues(engine::DataAndTurned(tried.given.columns.values.col(0), pictures, seed));
  Eigen::RowVectorXd lack_of_fit = Eigen::RowVectorXd::Ones(linear.cols());
  TOUCHSTONE_ASSIGN_OR_RETURN(lack_of_fit[0], LackOfFitP(photographs, selection, given, pool));
  engine::TriedPValues p_values(linear.rows() + 1, linear.cols());
  p_values << linear, lack_of_fit;
  return p_values;
}

// The rows of the fine search. Edges that lie elsewhere than expected look like noise before; and how bright a clipped pixel
// is depends on the noise.
absl::Status PrepareFine(const Photographs& photographs, const engine::Fit& coarse,
                         const std::vector<engine::Candidate>& candidates, const DiagnosisContext& context,
                         PhotoSelection* selection) {
  selection->photographs = std::make_unique<Photographs>(photographs);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(photographs, coarse.model.base(), false, context.pool));
  selection->photographs->noise = NoiseOfResiduals(photographs, expected, context.pool);
  selection->photographs->record = std::make_shared<const RecordTable>(selection->photographs->noise);
  PhotoRowsOptions options;
  options.cells = kPhotoSearchRules.fine_cells;
  options.smoothing = kPhotoSearchRules.fine_smoothing;
  options.max_photographs = kPhotoSearchRules.fine_photographs;
  options.contour_px2 = ContourPlaceVariance(*selection->photographs, expected, context.pool);
  TOUCHSTONE_ASSIGN_OR_RETURN(selection->fine, MakePhotoSearch(*selection->photographs, coarse.model.base(),
                                                               candidates, options, context));
  return absl::OkStatus();
}

// What the explanation does without, by the table of hypotheses.
absl::Status Revise(const DiagnosisContext& context, PhotoSelection* selection) {
  using P = PhotoHypothesis;
  return selection->found.Ask(
      {{P::kFaintField, [&] { return DropFaintField(selection); }},
       {P::kUnsteady, [&] { return DropUnsteady(selection); }},
       {P::kLargeStep, [&] { return AddLargeSteps(*selection->photographs, context, selection); }},
       {P::kChoice, [&] { return HoldChoices(selection); }},
       {P::kWithoutGain, [&] {
          selection->field = IndexOfImageField(selection->fit.model.base());
          return KeepStepsWithGain(*selection->photographs, context, selection);
        }}});
}

// Log evidence of a smooth error of the albedo over none, where the explanation is as it is.
double AlbedoNats(const PhotoSelection& selection) {
  const engine::Likelihood& likelihood = *selection.fine.likelihood;
  const engine::Likelihood::Columns residual = likelihood.Prepare(selection.fit.columns.values.col(0));
  std::vector<double> with;
  const double none =
      likelihood.LogPrior(0) + likelihood.LogLikelihood(likelihood.Gram(residual, 0)(0, 0), 0);
  for (int s = 1; s < static_cast<int>(likelihood.hypotheses().size()); ++s)
    with.push_back(likelihood.LogPrior(s) + likelihood.LogLikelihood(likelihood.Gram(residual, s)(0, 0), s));
  return engine::LogSum(with) - none;
}

}  // namespace

absl::StatusOr<PhotoSelection> SelectPhotoExplanation(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const DiagnosisContext& context) {
  const std::vector<engine::Candidate> candidates = PhotoCandidates(input, photographs);
  const engine::Parameterization base(*input.model, photographs.objects);
  PhotoSelection selection;
  selection.initial_effects = static_cast<int>(input.model->effects.size());
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("fitting", 0.2));
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation explanation,
                              ExplainCoarsely(input, photographs, candidates, context));
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("fitting", 0.35));
  TOUCHSTONE_RETURN_IF_ERROR(PrepareFine(photographs, explanation.fit, candidates, context, &selection));
  selection.fine.experiment->settled = input.settled;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("fitting", 0.5));
  TOUCHSTONE_ASSIGN_OR_RETURN(selection.initial, engine::FitModel(*selection.fine.experiment, base));
  TOUCHSTONE_ASSIGN_OR_RETURN(selection.tried,
                              TryOnPictures(photographs, selection, *input.model, input.seed, context.pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(explanation, selection.fine.search->Continue(explanation));
  selection.fit = std::move(explanation.fit);
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("fitting", 0.7));
  TOUCHSTONE_RETURN_IF_ERROR(Revise(context, &selection));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      selection.steps,
      engine::FindCompetitors(*selection.fine.search, {selection.fit, selection.initial_effects},
                              selection.field, {}));
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("fitting", 0.8));
  if (selection.field < 0 && !selection.rungs.empty()) {
    selection.heldout_ratio = selection.rungs.back().heldout_ratio;  // of the same fit
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(selection.heldout_ratio,
                                HeldOutRatio(*selection.photographs, *selection.fine.rows,
                                             *selection.fine.experiment, selection.fit));
  }
  selection.albedo_nats = AlbedoNats(selection);
  return selection;
}

}  // namespace touchstone::diagnosis::images
