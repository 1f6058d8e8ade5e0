#include "server/diagnosis/engine/search/candidates.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <algorithm>

#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

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

bool HasEffect(const model::Model& model, const std::string& name) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [&](const model::EffectInstance& instance) { return NameOf(*instance.effect) == name; });
}

bool IsDeclaredConfounded(const model::Effect& one, const std::string& other) {
  const std::string name(absl::StripPrefix(other, kGivenPrefix));
  return !DeclaredBy(one.name, name).empty() || !DeclaredBy(name, one.name).empty();
}

std::string DeclaredMeasurement(const std::string& effect, const std::string& other) {
  const std::string text = DeclaredBy(effect, other);
  return text.empty() ? DeclaredBy(other, effect) : text;
}

std::string DiscriminatingMeasurement(const std::vector<std::string>& names) {
  std::vector<std::string> effects;
  for (const std::string& name : names) effects.emplace_back(absl::StripPrefix(name, kGivenPrefix));
  const auto declared = [&](size_t i, size_t j) { return DeclaredMeasurement(effects[i], effects[j]); };
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

}  // namespace touchstone::diagnosis::engine
