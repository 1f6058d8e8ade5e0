#include "server/diagnosis/images/search/photo_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/base/status.h"
#include "server/diagnosis/engine/effect_columns.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/search/photo_quality.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::images {
namespace {

// Exposure, optics and place may all be off at once: each of them alone hides what the others take.
constexpr int kMaxTrialSteps = 2;
// Noise of coarse rows, over that of pixels, from where pictures may lie tens of pixels off: kFar goes before kCoarse, where
// the image field would take a displaced object for a stain. A focal length 8 % off gives 38, a principal point 30 of 224 px
// off 190, 15 of 112 px off 48.
constexpr double kFarSigma = 20;
// Of that noise, the most that what kFar has found may leave: otherwise it was no displacement.
constexpr double kFarLeaves = 0.5;
constexpr PhotoRowsOptions kFar = {196, 3, 15, kUnknownPlacePx2, kMaxTrialSteps};
constexpr PhotoRowsOptions kCoarse = {1600, 2, 15, kUnknownPlacePx2, kMaxTrialSteps};
constexpr PhotoRowsOptions kFine = {12544, 1, 30};
constexpr int kCoarsePasses = 3;               // searches, each at what the one before has found
constexpr double kStepP = 1e-4;                // of a step's values, with the scatter between pictures
constexpr double kFaint = 0.1;                 // of the noise
constexpr double kWidthStarts[] = {0.5, 1.0};  // over the typical size
constexpr double kMinDeclaredShare = 0.1;      // engine::SearchRules: gamma in the place of exposure has 0.02
constexpr int kMaxRefits = 4, kMaxRareRefits = 2;
constexpr int kAnchorPasses = 5;
constexpr double kAnchorStays =
    1;  // standard errors by which a value moves from an anchor that is near enough

// Where the last of several parameters changes nothing until the first does, further places to start from; and for
// widths, which blur so little near zero that no slope leads away from there.
void AddStarts(const engine::Candidate& candidate, int fingers, std::vector<engine::Candidate>* all) {
  const model::Effect& effect = *candidate.effect;
  if (MovesRays(effect) || effect.parameters.empty() || effect.formula != nullptr) return;
  const model::ParameterInfo& last = effect.parameters.back();
  const bool width = effect.parameters.size() == 1 && last.unit == Unit::kPixel && last.lower == last.neutral;
  if (effect.parameters.size() < 2 && !width) return;
  std::vector<double> tried = {last.neutral};
  const std::vector<double> starts =
      width ? std::vector<double>(std::begin(kWidthStarts), std::end(kWidthStarts))
            : std::vector<double>{-1.0, 1.0, 2.0};
  for (const double times : starts) {
    const double value = std::clamp(last.neutral + times * last.typical, last.lower, last.upper);
    if (std::find(tried.begin(), tried.end(), value) != tried.end()) continue;
    tried.push_back(value);
    engine::Candidate further = candidate;
    further.starts_at = effect.NeutralValues(fingers);
    further.starts_at.back() = value * SiFactor(last.unit);
    all->push_back(std::move(further));
  }
}

// Whether the values of effect `index` differ from what changes nothing, under this covariance.
bool IsSeen(const engine::Fit& fit, int index, const Eigen::MatrixXd& covariance) {
  std::vector<int> own;
  for (int i = 0; i < fit.model.size(); ++i)
    if (fit.model.parameters()[i].effect == index) own.push_back(i);
  const int n = static_cast<int>(own.size());
  Eigen::VectorXd value(n);
  Eigen::MatrixXd part(n, n);
  for (int a = 0; a < n; ++a) {
    value[a] = fit.point[own[a]] - fit.model.parameters()[own[a]].neutral;
    for (int b = 0; b < n; ++b) part(a, b) = covariance(own[a], own[b]);
  }
  return engine::WaldP(value, part) < kStepP;
}

// A field that is small against the noise is what simulation and noise are known to, not dirt.
absl::Status DropFaintField(PhotoSelection* selection) {
  const std::vector<model::EffectInstance>& effects = selection->fit.model.base().effects;
  for (int index = 0; index < static_cast<int>(effects.size()); ++index) {
    if (effects[index].effect->name != kImageFieldName) continue;
    const int side = 64;  // of a coarse picture
    const Eigen::VectorXf values =
        Eigen::Map<const Eigen::VectorXd>(effects[index].values.data(), kImageFieldSize).cast<float>();
    const Eigen::VectorXf field = ImageFieldFunctions(side, side) * values;
    const double rms = field.norm() / side;
    if (rms > kFaint * selection->photographs->noise.sigma_grey) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(
        selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(index)));
    return absl::OkStatus();
  }
  return absl::OkStatus();
}

// Steps whose values the scatter between pictures could make go.
absl::Status DropUnsteady(PhotoSelection* selection) {
  for (bool dropped = true; dropped;) {
    dropped = false;
    selection->covariance = CovarianceBetweenBlocks(*selection->fine.experiment, selection->fit);
    for (int index = static_cast<int>(selection->fit.model.base().effects.size()) - 1;
         index >= selection->initial_effects && !dropped; --index) {
      if (IsSeen(selection->fit, index, selection->covariance)) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(
          selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(index)));
      dropped = true;
    }
  }
  return absl::OkStatus();
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
  for (int pass = 0; pass < kAnchorPasses; ++pass) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const PhotoSearch there,
        MakePhotoSearch(photographs, explanation->fit.model.base(), {}, kCoarse, context));
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit fit, engine::FitModel(*there.experiment, explanation->fit.model));
    double farthest = 0;  // standard errors
    for (int i = 0; i < fit.model.size(); ++i)
      if (fit.covariance(i, i) > 0)
        farthest = std::max(
            farthest, std::abs(fit.point[i] - explanation->fit.point[i]) / std::sqrt(fit.covariance(i, i)));
    explanation->fit = std::move(fit);
    if (farthest < kAnchorStays) break;
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
  TOUCHSTONE_ASSIGN_OR_RETURN(PhotoSearch coarse, search(kCoarse, candidates));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      explanation.fit,
      engine::FitModel(*coarse.experiment, engine::Parameterization(*input.model, photographs.objects)));
  if (explanation.fit.sigma > kFarSigma) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const PhotoSearch far, search(kFar, NamedOfRig(candidates)));
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation found, far.search->Continue(explanation));
    TOUCHSTONE_RETURN_IF_ERROR(MoveAnchor(photographs, context, &found));
    if (MovesRaysBeyond(found) && found.fit.sigma < kFarLeaves * explanation.fit.sigma) {
      explanation = std::move(found);
      anchor = explanation.fit.model.base();
      TOUCHSTONE_ASSIGN_OR_RETURN(coarse, search(kCoarse, candidates));
    }
  }
  for (int pass = 0; pass < kCoarsePasses; ++pass) {
    const size_t had = explanation.fit.model.base().effects.size();
    if (pass > 0) {
      TOUCHSTONE_ASSIGN_OR_RETURN(coarse, search(kCoarse, candidates));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(explanation, coarse.search->Continue(explanation));
    TOUCHSTONE_RETURN_IF_ERROR(MoveAnchor(photographs, context, &explanation));
    anchor = explanation.fit.model.base();
    if (anchor.effects.size() == had || !MovesRaysBeyond(explanation)) break;
  }
  return explanation;
}

}  // namespace

std::vector<engine::Candidate> NamedOfRig(const std::vector<engine::Candidate>& candidates) {
  std::vector<engine::Candidate> named;
  for (const engine::Candidate& candidate : candidates)
    if (!candidate.nameless && !candidate.per_object && candidate.object.empty()) named.push_back(candidate);
  return named;
}

std::vector<engine::Candidate> PhotoCandidates(const DiagnosisInput& input, const Photographs& photographs) {
  std::vector<engine::Candidate> candidates;
  std::vector<std::shared_ptr<const model::Effect>> effects;
  for (const auto& effect : effects::TouchEffects())
    if (effect->moves_surface && !input.IsSettled(effect->name)) effects.push_back(effect);
  for (const auto& effect : effects::PhotoEffects()) effects.push_back(effect);
  effects.push_back(ImageFieldEffect());
  for (const auto& effect : effects) {
    if (effect->parameters.empty() || !ShowsInPhotographs(*effect) ||
        engine::HasEffect(*input.model, engine::NameOf(*effect)))
      continue;
    engine::Candidate candidate;
    candidate.effect = effect;
    candidate.nameless = effect->name == kImageFieldName;
    candidates.push_back(candidate);
    if (candidate.nameless) continue;
    AddStarts(candidate, input.model->fingers, &candidates);
    if (!effect->often_per_object || photographs.objects.size() < 2) continue;
    candidate.per_object = true;
    candidates.push_back(candidate);
    for (const std::string& object : photographs.objects) {
      candidate.object = object;
      candidate.rare = true;
      candidates.push_back(candidate);
    }
  }
  for (const auto& effect : input.also)
    if (ShowsInPhotographs(*effect) && effect->of_photos() &&
        !engine::HasEffect(*input.model, engine::NameOf(*effect))) {
      engine::Candidate candidate;
      candidate.effect = effect;
      candidate.of_user = true;
      candidates.push_back(candidate);
    }
  return candidates;
}

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
  rules.max_refits = kMaxRefits;
  rules.max_rare_refits = kMaxRareRefits;
  rules.min_declared_share = kMinDeclaredShare;
  rules.max_trial_steps = options.max_trial_steps;
  made.search = std::make_unique<engine::StepwiseSearch>(*made.experiment, candidates, rules,
                                                         [](const std::string&) {});
  return made;
}

namespace {

// Pictures are what is independent: the pixels of one share their errors.
absl::StatusOr<engine::TriedPValues> TryOnPictures(const PhotoSearch& search, const model::Model& given,
                                                   uint64_t seed) {
  constexpr size_t kMinPictures = 8;
  const PhotoRows& rows = *search.rows;
  std::vector<int> pictures;
  for (int row = 0; row < rows.rows(); ++row)
    if (row == 0 || rows.PhotographOfRow(row) != rows.PhotographOfRow(row - 1)) pictures.push_back(row);
  if (pictures.size() < kMinPictures) return engine::TriedPValues();
  pictures.push_back(rows.rows());
  TOUCHSTONE_ASSIGN_OR_RETURN(const engine::GivenAndEffects tried,
                              engine::ColumnsOfEffects(*search.search, given));
  engine::LinearHypotheses hypotheses(0, pictures);
  hypotheses.AddEffects(rows, tried.effects);
  return hypotheses.PValues(engine::DataAndTurned(tried.given.columns.values.col(0), pictures, seed));
}

}  // namespace

absl::StatusOr<PhotoSelection> SelectPhotoExplanation(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const DiagnosisContext& context) {
  const std::vector<engine::Candidate> candidates = PhotoCandidates(input, photographs);
  const engine::Parameterization base(*input.model, photographs.objects);
  const auto enter = [&](const char* stage, double done) {
    return !context.progress || context.progress(stage, done)
               ? absl::OkStatus()
               : absl::CancelledError("the diagnosis was cancelled");
  };
  PhotoSelection selection;
  selection.initial_effects = static_cast<int>(input.model->effects.size());
  TOUCHSTONE_RETURN_IF_ERROR(enter("fitting", 0.2));
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation explanation,
                              ExplainCoarsely(input, photographs, candidates, context));
  TOUCHSTONE_RETURN_IF_ERROR(enter("fitting", 0.35));
  // Edges that lie elsewhere than expected look like noise before; and how bright a clipped pixel is depends on the noise.
  selection.photographs = std::make_unique<Photographs>(photographs);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::vector<image::Photo> expected,
      ExpectPhotographs(photographs, explanation.fit.model.base(), false, context.pool));
  selection.photographs->noise = NoiseOfResiduals(photographs, expected, context.pool);
  selection.photographs->record = std::make_shared<const RecordTable>(selection.photographs->noise);
  PhotoRowsOptions options = kFine;
  options.contour_px2 = ContourPlaceVariance(*selection.photographs, expected, context.pool);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      selection.fine,
      MakePhotoSearch(*selection.photographs, explanation.fit.model.base(), candidates, options, context));
  selection.fine.experiment->settled = input.settled;
  TOUCHSTONE_RETURN_IF_ERROR(enter("fitting", 0.5));
  TOUCHSTONE_ASSIGN_OR_RETURN(selection.initial, engine::FitModel(*selection.fine.experiment, base));
  TOUCHSTONE_ASSIGN_OR_RETURN(selection.tried, TryOnPictures(selection.fine, *input.model, input.seed));
  TOUCHSTONE_ASSIGN_OR_RETURN(explanation, selection.fine.search->Continue(explanation));
  selection.fit = std::move(explanation.fit);
  TOUCHSTONE_RETURN_IF_ERROR(enter("fitting", 0.7));
  TOUCHSTONE_RETURN_IF_ERROR(DropFaintField(&selection));
  TOUCHSTONE_RETURN_IF_ERROR(DropUnsteady(&selection));
  TOUCHSTONE_RETURN_IF_ERROR(AddLargeSteps(*selection.photographs, context, &selection));
  TOUCHSTONE_RETURN_IF_ERROR(HoldChoices(&selection));
  for (size_t e = 0; e < selection.fit.model.base().effects.size(); ++e)
    if (selection.fit.model.base().effects[e].effect->name == kImageFieldName)
      selection.field = static_cast<int>(e);
  TOUCHSTONE_RETURN_IF_ERROR(KeepStepsWithGain(*selection.photographs, context, &selection));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      selection.steps,
      engine::FindCompetitors(*selection.fine.search, {selection.fit, selection.initial_effects},
                              selection.field, {}));
  TOUCHSTONE_RETURN_IF_ERROR(enter("fitting", 0.8));
  if (selection.field < 0 && !selection.rungs.empty()) {
    selection.heldout_ratio = selection.rungs.back().heldout_ratio;  // of the same fit
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(selection.heldout_ratio,
                                HeldOutRatio(*selection.photographs, *selection.fine.rows,
                                             *selection.fine.experiment, selection.fit));
  }
  const engine::Likelihood& likelihood = *selection.fine.likelihood;
  const engine::Likelihood::Columns residual = likelihood.Prepare(selection.fit.columns.values.col(0));
  std::vector<double> with;
  const double none =
      likelihood.LogPrior(0) + likelihood.LogLikelihood(likelihood.Gram(residual, 0)(0, 0), 0);
  for (int s = 1; s < static_cast<int>(likelihood.hypotheses().size()); ++s)
    with.push_back(likelihood.LogPrior(s) + likelihood.LogLikelihood(likelihood.Gram(residual, s)(0, 0), s));
  selection.albedo_nats = engine::LogSum(with) - none;
  return selection;
}

}  // namespace touchstone::diagnosis::images
