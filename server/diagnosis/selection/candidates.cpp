#include "server/diagnosis/selection/candidates.h"

#include <algorithm>

#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/selection/rules.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

engine::Candidate MakeCandidate(std::shared_ptr<const model::Effect> effect, bool per_object, bool of_user) {
  engine::Candidate candidate;
  candidate.effect = std::move(effect);
  candidate.per_object = per_object;
  candidate.of_user = of_user;
  return candidate;
}

}  // namespace

std::vector<engine::Candidate> MakeCandidates(const DiagnosisInput& input,
                                              const touches::Observations& searched) {
  std::vector<engine::Candidate> candidates;
  const auto has = [&](const std::string& name) { return engine::HasEffect(*input.model, name); };
  for (const auto& effect : effects::TouchEffects()) {
    const bool describes_only = effect->parameters.empty();  // the entry for formulas
    if (describes_only || effect->random() || has(effect->name) || input.IsSettled(effect->name)) continue;
    if (effect->needs.session_time && !input.set->has_session_time) continue;
    candidates.push_back(MakeCandidate(effect, effect->always_per_object, false));
    if (searched.objects.size() < 2 || effect->always_per_object) continue;
    if (effect->often_per_object || searched.objects.size() <= kSelectionRules.max_objects_varied) {
      candidates.push_back(MakeCandidate(effect, true, false));
      candidates.back().rare = !effect->often_per_object;
    }
    for (const std::string& object : searched.objects) {
      candidates.push_back(MakeCandidate(effect, true, false));
      candidates.back().object = object;
      candidates.back().rare = true;
    }
  }
  for (const auto& effect : input.also)
    if (!has(engine::NameOf(*effect)) && !effect->random())
      candidates.push_back(MakeCandidate(effect, false, true));
  return candidates;
}

}  // namespace touchstone::diagnosis::selection
