#include "server/diagnosis/selection/touch_modality.h"

#include "server/base/status.h"
#include "server/diagnosis/selection/quality.h"

namespace touchstone::diagnosis::selection {

model::Model TouchPartOf(const model::Model& model) {
  model::Model part = model;
  part.effects.clear();
  for (const model::EffectInstance& instance : model.effects)
    if (!instance.effect->of_photos()) part.effects.push_back(instance);
  return part;
}

std::vector<model::EffectInstance> PhotographEffectsOf(const model::Model& model) {
  std::vector<model::EffectInstance> effects;
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->of_photos()) effects.push_back(instance);
  return effects;
}

absl::StatusOr<std::unique_ptr<TouchModality>> TouchModality::Make(const DiagnosisInput& input,
                                                                   const DiagnosisContext& context) {
  DiagnosisInput touches = input;
  touches.images = nullptr;
  touches.model = std::make_shared<const model::Model>(TouchPartOf(*input.model));
  std::unique_ptr<TouchModality> made(new TouchModality());
  made->context_ = context;
  TOUCHSTONE_ASSIGN_OR_RETURN(made->workspace_, MakeWorkspace(touches, context));
  if (context.progress) {
    made->workspace_->experiment.cancelled = [progress = context.progress] {
      return !progress("fitting the touches", 0);
    };
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(made->found_, SelectExplanation(made->workspace_.get()));
  return made;
}

const engine::SelectedStep* TouchModality::FoundAlone(const std::string& effect) const {
  for (const engine::SelectedStep& step : found_.steps)
    if (engine::NameOf(*found_.fit.model.base().effects[step.effect].effect) == effect) return &step;
  return nullptr;
}

absl::StatusOr<engine::Quality> TouchModality::Compare(const model::Model& model) const {
  DiagnosisInput input = workspace_->input;
  input.model = std::make_shared<const model::Model>(TouchPartOf(model));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<Workspace> compared, MakeWorkspace(input, context_));
  const touches::Observations& o = *compared->observations;
  return QualityAsCompared(o, touches::Residuals(o, compared->nominal));
}

}  // namespace touchstone::diagnosis::selection
