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

bool AnyOfPhotos(const std::vector<std::string>& effects) {
  return std::any_of(effects.begin(), effects.end(), [](const std::string& name) {
    const auto effect = effects::Catalogue().Find(name);
    return effect != nullptr && effect->of_photos();
  });
}

// Effects of photographs have no speed or fingers to vary, but each has a check of its own.
std::string CheckEach(const std::vector<std::string>& effects) {
  std::string text = "Check each by itself.";
  for (const std::string& name : effects)
    if (const auto effect = effects::Catalogue().Find(name);
        effect != nullptr && !effect->check_on_rig.empty())
      absl::StrAppend(&text, " For ", name, ": ", effect->check_on_rig);
  return text;
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
  const auto declared = [&](size_t i, size_t j) {
    const std::string text = DeclaredBy(effects[i], effects[j]);
    return text.empty() ? DeclaredBy(effects[j], effects[i]) : text;
  };
  // What tells the first from each of the others; or any two of the others apart.
  std::vector<std::string> texts;
  for (size_t j = 1; j < effects.size(); ++j)
    if (const std::string text = declared(0, j);
        !text.empty() && std::find(texts.begin(), texts.end(), text) == texts.end())
      texts.push_back(text);
  for (size_t i = 1; i < effects.size() && texts.empty(); ++i)
    for (size_t j = i + 1; j < effects.size() && texts.empty(); ++j)
      if (const std::string text = declared(i, j); !text.empty()) texts.push_back(text);
  if (!texts.empty()) return absl::StrJoin(texts, " ");
  if (effects.size() > 1 && AnyOfPhotos(effects)) return CheckEach(effects);
  for (const std::string& effect : effects)
    if (std::string text = DeclaredBy(effect, ""); !text.empty()) return text;
  return absl::StrCat(
      "Touch at another speed, swap the fingers, or turn the object: whatever differs between ",
      absl::StrJoin(effects, " and "), " on the rig; `touchstone propose` looks for touches that do.");
}

}  // namespace touchstone::diagnosis::selection
