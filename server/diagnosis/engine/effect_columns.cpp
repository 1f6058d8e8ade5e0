#include "server/diagnosis/engine/effect_columns.h"

#include <map>
#include <string>

#include "server/base/status.h"

namespace touchstone::diagnosis::engine {

absl::StatusOr<GivenAndEffects> ColumnsOfEffects(const StepwiseSearch& search, const model::Model& given) {
  const Experiment& experiment = search.experiment();
  GivenAndEffects all;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      all.given, FitModel(experiment, Parameterization(given, experiment.observations->groups()), 0));
  std::map<std::string, int> on_all_objects;
  for (Extension& extension : search.ListExtensions(all.given, static_cast<int>(given.effects.size()))) {
    const bool by_object = extension.candidate >= 0 && extension.start.size() > all.given.model.size() &&
                           !extension.start.parameters().back().object.empty();
    const auto shared = on_all_objects.find(extension.name);
    EffectColumns own;
    if (by_object && shared != on_all_objects.end()) {
      own.shared = shared->second;
    } else {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          own.columns, Derivatives(experiment, extension.start, extension.start.Start(), all.given.predicted,
                                   all.given.model.size()));
      if (extension.candidate >= 0 && !by_object)
        on_all_objects.emplace(extension.name, static_cast<int>(all.effects.size()));
    }
    own.extension = std::move(extension);
    all.effects.push_back(std::move(own));
  }
  return all;
}

}  // namespace touchstone::diagnosis::engine
