#include "server/diagnosis/selection/candidates.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <algorithm>

#include "server/diagnosis/inference/parameterization.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr size_t kMaxObjectsVaried = 12;  // with a value each, of effects that seldom differ between objects

// A ramp that ends before the first contact leaves no trace. These end a little before and after the usual travel;
// the free parameter is 1 / acceleration.
std::vector<double> RampStarts(const touches::Observations& o) {
  const double speed_m_s = o.set->speed_m_s[o.row[0]], travel_m = o.set->standoff_m[o.row[0]];
  std::vector<double> starts;
  for (const double share : {0.7, 1.3}) starts.push_back(2 * share * travel_m / (speed_m_s * speed_m_s));
  return starts;
}

Candidate MakeCandidate(std::shared_ptr<const model::Effect> effect, bool per_object, bool of_user,
                        const touches::Observations& searched) {
  Candidate candidate;
  candidate.effect = std::move(effect);
  candidate.per_object = per_object;
  candidate.of_user = of_user;
  const std::vector<model::ParameterInfo>& parameters = candidate.effect->parameters;
  if (!parameters.empty() && parameters.back().reciprocal && searched.size() > 0)
    candidate.further_starts = RampStarts(searched);
  return candidate;
}

// What effect `one` declares about telling it from `other`; empty: nothing.
std::string DeclaredBy(const std::string& one, const std::string& other) {
  const auto effect = effects::Catalogue().Find(one);
  if (effect == nullptr) return "";
  for (const model::ConfoundedEffect& confounded : effect->confounded_with)
    if (confounded.effect == other) return confounded.discriminating_measurement;
  return "";
}

}  // namespace

std::vector<Candidate> MakeCandidates(const DiagnosisInput& input, const touches::Observations& searched) {
  std::vector<Candidate> candidates;
  const auto has = [&](const std::string& name) {
    return std::any_of(
        input.model->effects.begin(), input.model->effects.end(),
        [&](const model::EffectInstance& instance) { return inference::NameOf(*instance.effect) == name; });
  };
  for (const auto& effect : effects::TouchEffects()) {
    const bool describes_only = effect->parameters.empty();  // the entry for formulas
    if (describes_only || effect->random() || has(effect->name) || input.IsSettled(effect->name)) continue;
    if (effect->needs.session_time && !input.set->has_session_time) continue;
    candidates.push_back(MakeCandidate(effect, effect->always_per_object, false, searched));
    if (searched.objects.size() < 2 || effect->always_per_object) continue;
    if (effect->often_per_object || searched.objects.size() <= kMaxObjectsVaried) {
      candidates.push_back(MakeCandidate(effect, true, false, searched));
      candidates.back().rare = !effect->often_per_object;
    }
    for (const std::string& object : searched.objects) {
      candidates.push_back(MakeCandidate(effect, true, false, searched));
      candidates.back().object = object;
      candidates.back().rare = true;
    }
  }
  for (const auto& effect : input.also)
    if (!has(inference::NameOf(*effect)) && !effect->random())
      candidates.push_back(MakeCandidate(effect, false, true, searched));
  return candidates;
}

bool IsDeclaredConfounded(const model::Effect& one, const std::string& other) {
  const std::string name(absl::StripPrefix(other, kGivenPrefix));
  return !DeclaredBy(one.name, name).empty() || !DeclaredBy(name, one.name).empty();
}

std::string DiscriminatingMeasurement(const std::vector<std::string>& names) {
  std::vector<std::string> effects;
  for (const std::string& name : names) effects.emplace_back(absl::StripPrefix(name, kGivenPrefix));
  for (size_t i = 0; i < effects.size(); ++i)
    for (size_t j = i + 1; j < effects.size(); ++j)
      for (const std::string& text : {DeclaredBy(effects[i], effects[j]), DeclaredBy(effects[j], effects[i])})
        if (!text.empty()) return text;
  for (const std::string& effect : effects)
    if (std::string text = DeclaredBy(effect, ""); !text.empty()) return text;
  return absl::StrCat(
      "Touch at another speed, swap the fingers, or turn the object: whatever differs between ",
      absl::StrJoin(effects, " and "), " on the rig; `touchstone propose` looks for touches that do.");
}

}  // namespace touchstone::diagnosis::selection
