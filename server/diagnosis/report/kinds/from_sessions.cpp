#include "server/diagnosis/report/kinds/from_sessions.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "server/diagnosis/engine/ladder/ladder.h"

namespace touchstone::diagnosis::report {

Step StepOfSessions(const joint::SessionStep& found, const joint::SessionChanges& changes,
                    const std::string& last) {
  Step step;
  step.effect = found.effect;
  step.equivalent = found.equivalent;
  step.probability = found.probability;
  step.gain_nats = found.gain_nats;
  step.parameters = found.parameters;
  step.model = found.models.back();
  for (const model::EffectInstance& instance : step.model.effects) {
    if (engine::NameOf(*instance.effect) != found.effect) continue;
    step.scope = instance.per_object ? engine::EffectScope::kObject : engine::EffectScope::kRig;
    engine::AddTexts(*instance.effect, &step);
  }
  const bool changed =
      std::any_of(changes.effects.begin(), changes.effects.end(), [&](const joint::ComparedEffect& compared) {
        return compared.effect == found.effect && compared.values == joint::SessionValues::kOwn;
      });
  if (changed)
    engine::AddWords(absl::StrCat("Changed between the sessions: the values are those of ", last, "."),
                     &step);
  if (!step.equivalent.empty()) {
    std::vector<std::string> names = step.equivalent;
    names.insert(names.begin(), step.effect);
    step.discriminating_measurement = engine::DiscriminatingMeasurement(names);
  }
  return step;
}

}  // namespace touchstone::diagnosis::report
