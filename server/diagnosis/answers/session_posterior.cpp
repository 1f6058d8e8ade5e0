#include "server/diagnosis/answers/session_posterior.h"

#include "server/diagnosis/joint/between_sessions.h"
#include "server/diagnosis/joint/rules.h"
#include "server/model/value_names.h"

namespace touchstone::diagnosis {
namespace {

// In the unit of files; nothing: too few sessions have the value.
std::optional<double> ScatterOf(const joint::ComparedValue& value) {
  std::vector<joint::SessionEstimate> known;
  for (const auto& estimate : value.by_session)
    if (estimate && estimate->std_error > 0) known.push_back({estimate->value, estimate->std_error});
  if (known.size() < joint::kJointRules.min_for_scatter) return std::nullopt;
  return joint::MakeControlChart(known).inside.std_deviation;
}

bool IsOf(const joint::ComparedValue& value, const std::string& parameter, const std::string& entry) {
  for (const auto& estimate : value.by_session)
    if (estimate) return estimate->name == parameter && estimate->entry == entry;
  return false;
}

}  // namespace

void AddBetweenSessions(const std::vector<joint::ComparedEffect>& effects,
                        uncertainty::Posterior* posterior) {
  for (size_t i = 0; i < posterior->values.size(); ++i) {
    uncertainty::OpenValue& open = posterior->values[i];
    const model::ParameterInfo& parameter = posterior->ParameterOf(i);
    const std::string entry = model::EntryName(parameter, open.entry, posterior->model.fingers);
    for (const joint::ComparedEffect& effect : effects) {
      if (effect.effect != model::NameOf(posterior->EffectOf(i)) || effect.object != open.object) continue;
      for (const joint::ComparedValue& value : effect.entries) {
        const std::optional<double> scatter =
            IsOf(value, parameter.name, entry) ? ScatterOf(value) : std::nullopt;
        if (scatter) open.between_sessions = *scatter * SiFactor(parameter.unit);
      }
    }
  }
}

}  // namespace touchstone::diagnosis
