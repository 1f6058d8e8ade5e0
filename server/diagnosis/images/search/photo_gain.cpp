// What a step of photographs takes from the error: one that takes nothing is no step, one that takes most of it is one
// although something beside it remains.
#include <absl/status/status.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/step_order.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/search/photo_quality.h"
#include "server/diagnosis/images/search/photo_search.h"
#include "server/diagnosis/images/search/rules.h"

namespace touchstone::diagnosis::images {
namespace {

// Root mean square over all pixels of all photographs.
absl::StatusOr<double> ErrorOf(const Photographs& photographs, const model::Model& model, ThreadPool* pool) {
  std::vector<int> all(photographs.size());
  std::iota(all.begin(), all.end(), 0);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> squares,
                              SquaredErrors(photographs, WithoutImageField(model), all, pool));
  const double pixels =
      static_cast<double>(photographs.width()) * photographs.height() * std::max(photographs.size(), 1);
  return std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) / pixels);
}

// The noise that a perfect model would leave of these pictures.
absl::StatusOr<double> NoiseOfPixels(const Photographs& photographs, const model::Model& model,
                                     ThreadPool* pool) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(photographs, WithoutImageField(model), false, pool));
  double variance = 0, pixels = 0;
  for (const image::Photo& photo : expected) {
    for (const float grey : photo.grey) variance += photographs.record->Variance(grey);
    pixels += static_cast<double>(photo.grey.size());
  }
  return std::sqrt(variance / std::max(pixels, 1.0));
}

// One step after the other that takes most of what is left, without a smooth error of the albedo or the picture: those
// take the place of an effect that acts everywhere, and of what lies beside it.
class LargeSteps {
 public:
  LargeSteps(const Photographs& photographs, const DiagnosisContext& context, PhotoSelection* selection)
      : photographs_(photographs), pool_(context.pool), selection_(*selection) {}

  absl::Status Run() {
    PhotoSearch& fine = selection_.fine;
    TOUCHSTONE_ASSIGN_OR_RETURN(double left, ErrorOf(photographs_, selection_.fit.model.base(), pool_));
    TOUCHSTONE_ASSIGN_OR_RETURN(const double noise,
                                NoiseOfPixels(photographs_, selection_.fit.model.base(), pool_));
    if (left < kImageRules.clear_misfit * noise) return absl::OkStatus();
    auto plain = std::make_unique<engine::Likelihood>(fine.rows->GroupRows(), nullptr, 0, nullptr);
    plain->SetLeastNoise(1);
    engine::Experiment experiment = *fine.experiment;
    experiment.likelihood = plain.get();
    const auto quiet = [](const std::string&) {};
    const engine::StepwiseSearch search(experiment, NamedOfRig(fine.search->candidates()),
                                        fine.search->rules(), quiet);
    engine::Parameterization named = selection_.fit.model;
    if (const int field = IndexOfImageField(named.base()); field >= 0) named = named.Without(field);
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit fit, engine::FitModel(experiment, named));
    bool any = false;
    for (int step = 0; step < kPhotoSearchRules.max_large_steps && left >= kImageRules.clear_misfit * noise;
         ++step) {
      TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<Tried> best, Best(search, fit));
      if (!best) break;
      TOUCHSTONE_ASSIGN_OR_RETURN(const double ratio,
                                  HeldOutRatio(photographs_, *fine.rows, experiment, best->fit));
      const double unseen = best->left * ratio;
      if (left * left - unseen * unseen < kPhotoSearchRules.large_share * (left * left - noise * noise))
        break;
      fit = std::move(best->fit);
      left = best->left;
      any = true;
    }
    if (!any) return absl::OkStatus();
    fine.plain = std::move(plain);
    fine.experiment->likelihood = fine.plain.get();
    fine.search = std::make_unique<engine::StepwiseSearch>(
        *fine.experiment, NamedOfRig(fine.search->candidates()), fine.search->rules(), quiet);
    TOUCHSTONE_ASSIGN_OR_RETURN(selection_.initial,
                                engine::FitModel(*fine.experiment, selection_.initial.model));
    selection_.found.Add(PhotoHypothesis::kLargeStep);
    selection_.fit = std::move(fit);
    selection_.covariance = CovarianceBetweenBlocks(*fine.experiment, selection_.fit);
    return absl::OkStatus();
  }

 private:
  struct Tried {
    engine::Fit fit;
    double left = 0;
  };

  absl::StatusOr<std::optional<Tried>> Best(const engine::StepwiseSearch& search,
                                            const engine::Fit& fit) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<engine::Extension> extensions,
                                search.Score(fit, selection_.initial_effects));
    std::stable_sort(extensions.begin(), extensions.end(),
                     [](const auto& a, const auto& b) { return a.log_evidence > b.log_evidence; });
    std::optional<Tried> best;
    int tried = 0;
    for (const engine::Extension& extension : extensions) {
      if (!extension.Acts() || extension.candidate < 0) continue;
      if (tried++ == kPhotoSearchRules.max_large_tried) break;
      Tried next;
      TOUCHSTONE_ASSIGN_OR_RETURN(next.fit, search.FitExtension(extension));
      TOUCHSTONE_ASSIGN_OR_RETURN(next.left, ErrorOf(photographs_, next.fit.model.base(), pool_));
      if (!best || next.left < best->left) best = std::move(next);
    }
    return best;
  }

  const Photographs& photographs_;
  ThreadPool* pool_;
  PhotoSelection& selection_;
};

// The fits on the way to the whole explanation, which is its polished fit, with their errors.
class Rungs {
 public:
  Rungs(const Photographs& photographs, const DiagnosisContext& context, const PhotoSelection& selection)
      : photographs_(photographs),
        context_(context),
        selection_(selection),
        experiment_(*selection.fine.experiment) {}

  // Returns engine::StepOrder::without_gain; with -1 the rungs.
  absl::StatusOr<int> Make(std::vector<PhotoRung>* rungs) const {
    std::vector<engine::SelectedStep> steps;
    for (int e = selection_.initial_effects; e < static_cast<int>(selection_.fit.model.base().effects.size());
         ++e)
      if (e != selection_.field) steps.emplace_back().effect = e;
    TOUCHSTONE_ASSIGN_OR_RETURN(const double given, ErrorOfAll(selection_.initial));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        engine::StepOrder order,
        engine::OrderSteps(experiment_, {selection_.fit, selection_.initial_effects}, selection_.field, steps,
                           {given, given, 0},
                           [this](const engine::OrderedStep& step, const engine::Quality& last) {
                             return QualityOf(step, last);
                           }));
    for (engine::OrderedStep& step : order.steps) {
      const double ratio = step.quality.heldout_rmse / step.quality.rmse;
      rungs->push_back({step.step->effect, ShownFit(step), step.quality.rmse, ratio});
    }
    return order.without_gain;
  }

 private:
  absl::StatusOr<double> ErrorOfAll(const engine::Fit& fit) const {
    return ErrorOf(photographs_, fit.model.base(), context_.pool);
  }

  // Of the last, what is saved: the values of the whole explanation, without what has no name.
  engine::Fit ShownFit(const engine::OrderedStep& step) const {
    if (!step.last) return step.fit;
    engine::Fit fit = selection_.polished;
    if (selection_.field >= 0) fit.model = fit.model.Without(selection_.field);
    return fit;
  }

  // The error on unseen pictures takes longest.
  absl::StatusOr<engine::Quality> QualityOf(const engine::OrderedStep& step,
                                            const engine::Quality& last) const {
    engine::Quality quality = {0, INFINITY, 0};
    TOUCHSTONE_ASSIGN_OR_RETURN(quality.rmse, ErrorOfAll(ShownFit(step)));
    if (quality.rmse >= last.rmse) return quality;
    TOUCHSTONE_ASSIGN_OR_RETURN(const double ratio,
                                HeldOutRatio(photographs_, *selection_.fine.rows, experiment_, step.fit));
    quality.heldout_rmse = quality.rmse * ratio;
    return quality;
  }

  const Photographs& photographs_;
  const DiagnosisContext& context_;
  const PhotoSelection& selection_;
  const engine::Experiment& experiment_;
};

}  // namespace

absl::Status AddLargeSteps(const Photographs& photographs, const DiagnosisContext& context,
                           PhotoSelection* selection) {
  return LargeSteps(photographs, context, selection).Run();
}

absl::Status DropFaintField(PhotoSelection* selection) {
  const int index = IndexOfImageField(selection->fit.model.base());
  if (index < 0) return absl::OkStatus();
  const int side = kPhotoSearchRules.field_side;
  const std::vector<double>& values = selection->fit.model.base().effects[index].values;
  const Eigen::VectorXf field =
      ImageFieldFunctions(side, side) *
      Eigen::Map<const Eigen::VectorXd>(values.data(), kImageFieldSize).cast<float>();
  if (field.norm() / side > kPhotoSearchRules.faint * selection->photographs->noise.sigma_grey)
    return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(index)));
  return absl::OkStatus();
}

absl::Status DropUnsteady(PhotoSelection* selection) {
  for (bool dropped = true; dropped;) {
    dropped = false;
    selection->covariance = CovarianceBetweenBlocks(*selection->fine.experiment, selection->fit);
    for (int index = static_cast<int>(selection->fit.model.base().effects.size()) - 1;
         index >= selection->initial_effects && !dropped; --index) {
      if (engine::NeutralP(selection->fit.model, index, selection->fit.point, selection->covariance) <
          kPhotoSearchRules.step_p)
        continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(
          selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(index)));
      dropped = true;
    }
  }
  return absl::OkStatus();
}

absl::Status HoldChoices(PhotoSelection* selection) {
  for (int e = static_cast<int>(selection->fit.model.base().effects.size()) - 1; e >= 0; --e) {
    const model::EffectInstance& instance = selection->fit.model.base().effects[e];
    if (!selection->fit.model.IsFree(e) || instance.effect->parameters.empty() ||
        instance.effect->parameters[0].choices.empty())
      continue;
    engine::Parameterization held = selection->fit.model;
    Eigen::VectorXd point = held.Start();
    bool is_choice = true;
    for (int i = 0; i < held.size(); ++i) {
      if (held.parameters()[i].effect != e) continue;
      const double choice = std::round(point[i]);
      is_choice &= std::abs(point[i] - choice) < kPhotoSearchRules.near_choice &&
                   choice != held.parameters()[i].neutral;
      point[i] = choice;
    }
    held.MoveTo(point);
    if (is_choice || e < selection->initial_effects)
      held.Hold(e);
    else
      held = held.Without(e);
    TOUCHSTONE_ASSIGN_OR_RETURN(selection->fit, engine::FitModel(*selection->fine.experiment, held));
  }
  return absl::OkStatus();
}

absl::Status KeepStepsWithGain(const Photographs& photographs, const DiagnosisContext& context,
                               PhotoSelection* selection) {
  TOUCHSTONE_RETURN_IF_ERROR(PolishExplanation(photographs, context, selection));
  for (;;) {
    selection->rungs.clear();
    TOUCHSTONE_ASSIGN_OR_RETURN(const int effect,
                                Rungs(photographs, context, *selection).Make(&selection->rungs));
    if (effect < 0) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(
        selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(effect)));
    if (selection->field > effect) --selection->field;
    TOUCHSTONE_RETURN_IF_ERROR(PolishExplanation(photographs, context, selection));
  }
}

}  // namespace touchstone::diagnosis::images
