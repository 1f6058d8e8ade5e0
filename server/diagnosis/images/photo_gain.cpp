// What a step of photographs takes from the error: one that takes nothing is no step, one that takes most of it is one
// although something beside it remains.
#include <absl/status/status.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder.h"
#include "server/diagnosis/images/image_field.h"
#include "server/diagnosis/images/photo_quality.h"
#include "server/diagnosis/images/photo_search.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kLargeShare = 0.6;   // of the excess on unseen pictures, that a step beside a rest takes
constexpr double kLargeMisfit = 1.2;  // of the noise, from where such steps are looked for
constexpr double kNearChoice = 0.1;   // of a choice, that a fitted mean of two is it
constexpr int kMaxLargeSteps = 3, kMaxLargeTried = 4;

model::Model NamedPartOf(const model::Model& model) {
  model::Model named = model;
  named.effects.erase(
      std::remove_if(named.effects.begin(), named.effects.end(),
                     [](const auto& instance) { return instance.effect->name == kImageFieldName; }),
      named.effects.end());
  return named;
}

// Root mean square over all pixels of all photographs.
absl::StatusOr<double> ErrorOf(const Photographs& photographs, const model::Model& model, ThreadPool* pool) {
  std::vector<int> all(photographs.size());
  std::iota(all.begin(), all.end(), 0);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> squares,
                              SquaredErrors(photographs, NamedPartOf(model), all, pool));
  const double pixels =
      static_cast<double>(photographs.width()) * photographs.height() * std::max(photographs.size(), 1);
  return std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) / pixels);
}

// The noise that a perfect model would leave of these pictures.
absl::StatusOr<double> NoiseOfPixels(const Photographs& photographs, const model::Model& model,
                                     ThreadPool* pool) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(photographs, NamedPartOf(model), false, pool));
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
    if (left < kLargeMisfit * noise) return absl::OkStatus();
    auto plain = std::make_unique<engine::Likelihood>(fine.rows->GroupRows(), nullptr, 0, nullptr);
    plain->SetLeastNoise(1);
    engine::Experiment experiment = *fine.experiment;
    experiment.likelihood = plain.get();
    const auto quiet = [](const std::string&) {};
    const engine::StepwiseSearch search(experiment, NamedOfRig(fine.search->candidates()),
                                        fine.search->rules(), quiet);
    engine::Parameterization named = selection_.fit.model;
    for (int e = static_cast<int>(named.base().effects.size()) - 1; e >= 0; --e)
      if (named.base().effects[e].effect->name == kImageFieldName) named = named.Without(e);
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit fit, engine::FitModel(experiment, named));
    bool any = false;
    for (int step = 0; step < kMaxLargeSteps && left >= kLargeMisfit * noise; ++step) {
      TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<Tried> best, Best(search, fit));
      if (!best) break;
      TOUCHSTONE_ASSIGN_OR_RETURN(const double ratio,
                                  HeldOutRatio(photographs_, *fine.rows, experiment, best->fit));
      const double unseen = best->left * ratio;
      if (left * left - unseen * unseen < kLargeShare * (left * left - noise * noise)) break;
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
      if (!extension.visible || extension.candidate < 0) continue;
      if (tried++ == kMaxLargeTried) break;
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

// The fits on the way to the whole explanation, which is its polished fit, with their errors: up to the first without gain,
// whose effect is `idle` (-1: every step has one). What lies beyond is not fitted without its parts, which takes longest.
struct Rungs {
  std::vector<PhotoRung> rungs;
  std::vector<int> order;  // all effects
  int idle = -1;
};

absl::StatusOr<Rungs> RungsOf(const Photographs& photographs, const DiagnosisContext& context,
                              const PhotoSelection& selection, const std::vector<int>& at_end) {
  const engine::Experiment& experiment = *selection.fine.experiment;
  std::vector<engine::SelectedStep> steps;
  for (int e = selection.initial_effects; e < static_cast<int>(selection.fit.model.base().effects.size());
       ++e)
    if (e != selection.field) steps.emplace_back().effect = e;
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<engine::OrderedStep> ordered,
                              engine::OrderSteps(experiment, {selection.fit, selection.initial_effects},
                                                 selection.field, steps, at_end));
  TOUCHSTONE_ASSIGN_OR_RETURN(const double given,
                              ErrorOf(photographs, selection.initial.model.base(), context.pool));
  Rungs made;
  for (const engine::OrderedStep& step : ordered) made.order.push_back(step.step->effect);
  std::vector<engine::Quality> after;
  for (engine::OrderedStep& step : ordered) {
    const engine::Fit alone = step.fit;
    PhotoRung rung{step.step->effect, std::move(step.fit)};
    if (made.rungs.size() + 1 == ordered.size()) {
      // What is saved: the values of the whole explanation, without what has no name.
      rung.fit = selection.polished;
      if (selection.field >= 0) rung.fit.model = rung.fit.model.Without(selection.field);
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(rung.rmse, ErrorOf(photographs, rung.fit.model.base(), context.pool));
    const auto is_idle = [&](double heldout_rmse) {
      after.back().heldout_rmse = heldout_rmse;
      return engine::StepWithoutGain({given, given, 0}, after) >= 0;
    };
    made.idle = rung.effect;
    after.push_back({rung.rmse, 0, 0});
    if (is_idle(0)) return made;  // whatever unseen pictures say
    TOUCHSTONE_ASSIGN_OR_RETURN(rung.heldout_ratio,
                                HeldOutRatio(photographs, *selection.fine.rows, experiment, alone));
    if (is_idle(rung.rmse * rung.heldout_ratio)) return made;
    made.rungs.push_back(std::move(rung));
    made.idle = -1;
  }
  return made;
}

}  // namespace

absl::Status AddLargeSteps(const Photographs& photographs, const DiagnosisContext& context,
                           PhotoSelection* selection) {
  return LargeSteps(photographs, context, selection).Run();
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
      is_choice &= std::abs(point[i] - choice) < kNearChoice && choice != held.parameters()[i].neutral;
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
  for (engine::StepsAtEnd at_end;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(Rungs made, RungsOf(photographs, context, *selection, at_end.effects()));
    selection->rungs = std::move(made.rungs);
    const int effect = made.idle;
    if (effect < 0) return absl::OkStatus();
    if (at_end.MoveToEnd(effect, made.order)) continue;
    at_end.TakeOut(effect);
    TOUCHSTONE_ASSIGN_OR_RETURN(
        selection->fit, engine::FitModel(*selection->fine.experiment, selection->fit.model.Without(effect)));
    if (selection->field > effect) --selection->field;
    TOUCHSTONE_RETURN_IF_ERROR(PolishExplanation(photographs, context, selection));
  }
}

}  // namespace touchstone::diagnosis::images
