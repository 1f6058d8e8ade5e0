#include "server/diagnosis/selection/effect_columns.h"

#include <map>
#include <string>

#include "server/base/status.h"

namespace touchstone::diagnosis::selection {

absl::StatusOr<GivenAndEffects> ColumnsOfEffects(const Workspace& workspace,
                                                 const engine::StepwiseSearch& search) {
  const model::Model& model = *workspace.input.model;
  GivenAndEffects all;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      all.given, engine::FitModel(workspace.experiment,
                                  engine::Parameterization(model, workspace.searched->objects), 0));
  std::map<std::string, int> on_all_objects;
  for (engine::Extension& extension :
       search.ListExtensions(all.given, static_cast<int>(model.effects.size()))) {
    const bool by_object = extension.candidate >= 0 && extension.start.size() > all.given.model.size() &&
                           !extension.start.parameters().back().object.empty();
    const auto shared = on_all_objects.find(extension.name);
    EffectColumns own;
    if (by_object && shared != on_all_objects.end()) {
      own.shared = shared->second;
    } else {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          own.columns, engine::Derivatives(workspace.experiment, extension.start, extension.start.Start(),
                                           all.given.predicted, all.given.model.size()));
      if (extension.candidate >= 0 && !by_object)
        on_all_objects.emplace(extension.name, static_cast<int>(all.effects.size()));
    }
    own.extension = std::move(extension);
    all.effects.push_back(std::move(own));
  }
  return all;
}

}  // namespace touchstone::diagnosis::selection
