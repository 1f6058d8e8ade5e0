#include "server/diagnosis/selection/unsupported_steps.h"

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/selection/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

bool HasOwnValues(const engine::Fit& fit, int index) {
  return fit.model.base().effects[index].per_object;
}

double UnseenError(const Workspace& workspace, const engine::Fit& fit, bool by_block) {
  return by_block ? engine::HeldOutRmseByBlock(workspace.experiment, fit)
                  : engine::HeldOutRmse(workspace.experiment, fit);
}

// `without`: the fit without effect `index`.
absl::Status Replace(const Workspace& workspace, int index, engine::Fit without, SelectionResult* result) {
  result->fit = std::move(without);
  if (result->formula < 0) {
    result->without_formula = result->fit;
    return absl::OkStatus();
  }
  if (index < result->formula) --result->formula;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      result->without_formula,
      engine::FitModel(workspace.experiment, result->fit.model.Without(result->formula)));
  return absl::OkStatus();
}

}  // namespace

absl::Status TakeOut(const Workspace& workspace, int index, SelectionResult* result) {
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit without,
                              engine::FitModel(workspace.experiment, result->fit.model.Without(index)));
  return Replace(workspace, index, std::move(without), result);
}

absl::StatusOr<bool> DropUnseen(const Workspace& workspace, SelectionResult* result) {
  bool dropped = false;
  for (int index = static_cast<int>(result->fit.model.base().effects.size()) - 1;
       index >= result->initial_effects; --index) {
    if (index == result->formula) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit without,
                                engine::FitModel(workspace.experiment, result->fit.model.Without(index)));
    // Values of single objects cannot be predicted from other objects.
    bool by_block = false;
    for (int other = 0; other < static_cast<int>(result->fit.model.base().effects.size()); ++other)
      by_block |= HasOwnValues(result->fit, other);
    if (UnseenError(workspace, without, by_block) > UnseenError(workspace, result->fit, by_block)) continue;
    TOUCHSTONE_RETURN_IF_ERROR(Replace(workspace, index, std::move(without), result));
    dropped = true;
  }
  return dropped;
}

absl::StatusOr<bool> DropImprobable(const Workspace& workspace, SelectionResult* result) {
  if (result->formula < 0 && !result->curve) return false;
  bool dropped = false;
  for (auto step = result->steps.rbegin(); step != result->steps.rend(); ++step) {
    if (step->probability >= kSelectionRules.improbable) continue;
    TOUCHSTONE_RETURN_IF_ERROR(TakeOut(workspace, step->effect, result));
    dropped = true;
  }
  return dropped;
}

}  // namespace touchstone::diagnosis::selection
