#include "server/diagnosis/selection/memory_competition.h"

#include <algorithm>
#include <utility>

#include "server/base/status.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/diagnosis/selection/session/time_structure.h"

namespace touchstone::diagnosis::selection {
namespace {

// Whether the given model has correlated noise that the residuals do not rule out: it is what a course must be ahead of.
absl::StatusOr<bool> IsDeclaredMemory(const Workspace& workspace, const engine::Fit& fit) {
  const model::EffectInstance* declared = DeclaredMemoryOf(*workspace.input.model);
  if (declared == nullptr) return false;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              workspace.searched_predictor->Run(fit.model.base(), false, false));
  const touches::Observations& o = *workspace.searched;
  return !AssessDeclaredMemory(o, touches::Residuals(o, prediction), declared->values[0], declared->values[1])
              .absent;
}

// Effects that were found under noise without memory must be worth their values under correlated noise too.
absl::Status DropWhatIsCorrelated(const Workspace& workspace, NoiseMemory* memory, SelectionResult* result) {
  for (int index = static_cast<int>(result->fit.model.base().effects.size()) - 1;
       index >= result->initial_effects; --index) {
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit without,
                                engine::FitModel(workspace.experiment, result->fit.model.Without(index)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<NoiseMemory> other, MemoryOf(workspace, without));
    if (!other || other->log_likelihood < memory->log_likelihood - kSelectionRules.worth_under_memory)
      continue;
    result->fit = std::move(without);
    *memory = *other;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::optional<NoiseMemory>> MemoryOf(const Workspace& workspace, const engine::Fit& fit) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              workspace.searched_predictor->Run(fit.model.base(), false, false));
  const touches::Observations& o = *workspace.searched;
  return FindNoiseMemory(o, touches::Residuals(o, prediction));
}

absl::StatusOr<bool> TakeNoiseWithMemory(const Workspace& workspace, const engine::Fit& fit,
                                         double curve_nats, SelectionResult* result) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<NoiseMemory> memory, MemoryOf(workspace, fit));
  if (!memory) return false;
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool declared, IsDeclaredMemory(workspace, fit));
  const double course = std::max({curve_nats, memory->step_gain_nats, memory->period_gain_nats});
  if (declared ? course > memory->gain_nats + kSelectionRules.memory_ahead ||
                     memory->smooth_gain_nats > memory->gain_nats + kSelectionRules.memory_ahead
               : !memory->everywhere || memory->gain_nats < course + kSelectionRules.memory_ahead ||
                     memory->gain_nats < memory->smooth_gain_nats + kSelectionRules.memory_rougher)
    return false;
  result->fit = fit;
  TOUCHSTONE_RETURN_IF_ERROR(DropWhatIsCorrelated(workspace, &*memory, result));
  result->memory = std::move(memory);
  result->without_formula = result->fit;
  result->formula = -1;
  return true;
}

absl::Status LookForMemory(const Workspace& workspace, const engine::Fit& named, SelectionResult* result) {
  if (result->formula >= 0) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool declared, IsDeclaredMemory(workspace, named));
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              workspace.searched_predictor->Run(named.model.base(), false, false));
  const touches::Observations& o = *workspace.searched;
  if (!declared && !(FindTimeStructure(o, touches::Residuals(o, prediction)).p < kSessionRules.time_p))
    return absl::OkStatus();
  return TakeNoiseWithMemory(workspace, named, NamelessCurve().gain_nats, result).status();
}

}  // namespace touchstone::diagnosis::selection
