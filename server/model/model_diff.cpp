// What changed between two models, in words.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <set>

#include "server/model/fields/lookup_fields.h"
#include "server/model/fields/user_term_fields.h"
#include "server/model/model.h"
#include "server/model/parameter_values.h"
#include "server/model/surface_map_file.h"

namespace touchstone::model {
namespace {

std::string WithUnit(const ParameterInfo& parameter, const std::string& numbers) {
  const absl::string_view symbol = UnitSymbol(parameter.unit);
  return absl::StrCat(numbers, symbol.empty() ? "" : " ", symbol);
}

std::string NumbersOf(const Effect& effect, const std::vector<double>& values, int index, int fingers) {
  const ParameterInfo& parameter = effect.parameters[index];
  return FileNumbers(parameter, absl::MakeConstSpan(values).subspan(ValueOffset(effect, index, fingers),
                                                                    parameter.Count(fingers)));
}

// ": radius_mm = 1.5 mm, ..." of an effect that came or went.
std::string AllValues(const EffectInstance& instance, int fingers) {
  std::vector<std::string> parts;
  const Effect& effect = *instance.effect;
  if (effect.formula)
    parts.push_back(absl::StrCat(AddsName(*effect.formula), " += ", effect.formula->expression));
  if (effect.lookup) parts.push_back(LookupInWords(*effect.lookup));
  if (effect.surface_map) parts.push_back(SurfaceMapInWords(*effect.surface_map));
  for (size_t i = 0; i < effect.parameters.size(); ++i)
    parts.push_back(
        absl::StrCat(effect.parameters[i].name, " = ",
                     WithUnit(effect.parameters[i], NumbersOf(effect, instance.values, i, fingers))));
  if (instance.per_object && !effect.always_per_object) parts.push_back("for each object");
  for (const auto& [object, values] : instance.object_values)
    parts.push_back(absl::StrCat("own values for ", object));
  return parts.empty() ? "" : absl::StrCat(": ", absl::StrJoin(parts, ", "));
}

const EffectInstance* Find(const Model& model, const std::string& title) {
  for (const EffectInstance& instance : model.effects)
    if (EffectTitle(*instance.effect) == title) return &instance;
  return nullptr;
}

void CompareValues(const std::string& title, const std::string& object, const Effect& effect,
                   const std::vector<double>& before, int fingers_before, const std::vector<double>& after,
                   int fingers_after, std::vector<std::string>* lines) {
  for (size_t i = 0; i < effect.parameters.size(); ++i) {
    const std::string old_numbers = NumbersOf(effect, before, i, fingers_before);
    const std::string new_numbers = NumbersOf(effect, after, i, fingers_after);
    if (old_numbers == new_numbers) continue;
    lines->push_back(absl::StrCat(title, object.empty() ? "" : absl::StrCat(", object ", object), ": ",
                                  effect.parameters[i].name, " ", WithUnit(effect.parameters[i], old_numbers),
                                  " -> ", WithUnit(effect.parameters[i], new_numbers)));
  }
}

// The definition of a formula, without its values.
std::string Definition(const Effect& effect) {
  std::string text = absl::StrCat(AddsName(*effect.formula), " += ", effect.formula->expression, " in the ",
                                  StageName(effect.stage), " stage");
  for (const ParameterInfo& p : effect.parameters)
    absl::StrAppend(&text, ", ", p.name, " in ", WithUnit(p, absl::StrCat(p.lower, " to ", p.upper)));
  return text;
}

void CompareEffects(const EffectInstance& before, int fingers_before, const EffectInstance& after,
                    int fingers_after, std::vector<std::string>* lines) {
  const Effect& effect = *after.effect;
  const std::string title = EffectTitle(effect);
  if (effect.formula && Definition(*before.effect) != Definition(effect)) {
    lines->push_back(absl::StrCat(title, ": ", Definition(*before.effect), " -> ", Definition(effect)));
    // Values of other parameters cannot be set side by side.
    if (before.effect->ValueCount(fingers_before) != effect.ValueCount(fingers_after)) return;
  }
  if (effect.lookup && LookupDefinition(*before.effect->lookup) != LookupDefinition(*effect.lookup))
    lines->push_back(absl::StrCat(title, ": ", LookupInWords(*before.effect->lookup), " -> ",
                                  LookupInWords(*effect.lookup), ", values changed"));
  if (effect.surface_map &&
      FormatSurfaceMap(before.effect->surface_map->objects) != FormatSurfaceMap(effect.surface_map->objects))
    lines->push_back(absl::StrCat(title, ": ", SurfaceMapInWords(*before.effect->surface_map), " -> ",
                                  SurfaceMapInWords(*effect.surface_map), ", values changed"));
  if (before.per_object != after.per_object)
    lines->push_back(absl::StrCat(title, ": scope ", before.per_object ? "object -> rig" : "rig -> object"));
  CompareValues(title, "", effect, before.values, fingers_before, after.values, fingers_after, lines);
  std::set<std::string> objects;
  for (const auto& [object, values] : before.object_values) objects.insert(object);
  for (const auto& [object, values] : after.object_values) objects.insert(object);
  for (const std::string& object : objects) {
    const auto old_values = before.object_values.find(object);
    const auto new_values = after.object_values.find(object);
    const bool had = old_values != before.object_values.end();
    const bool has = new_values != after.object_values.end();
    if (had != has)
      lines->push_back(absl::StrCat(title, ", object ", object, ": own values ", has ? "added" : "removed"));
    CompareValues(title, object, effect, had ? old_values->second : before.values, fingers_before,
                  has ? new_values->second : after.values, fingers_after, lines);
  }
}

// The titles of the effects that both have, in the order of `model`.
std::vector<std::string> CommonOrder(const Model& model, const Model& other) {
  std::vector<std::string> order;
  for (const EffectInstance& instance : model.effects)
    if (Find(other, EffectTitle(*instance.effect)) != nullptr) order.push_back(EffectTitle(*instance.effect));
  return order;
}

}  // namespace

std::vector<std::string> DiffModels(const Model& before, const Model& after) {
  std::vector<std::string> lines;
  if (before.Hash() == after.Hash()) return lines;
  if (before.fingers != after.fingers)
    lines.push_back(absl::StrCat("end_effector: fingers ", before.fingers, " -> ", after.fingers));
  const std::string old_spacing = FileNumber(Unit::kMillimetre, before.spacing_m);
  const std::string new_spacing = FileNumber(Unit::kMillimetre, after.spacing_m);
  if (old_spacing != new_spacing)
    lines.push_back(absl::StrCat("end_effector: spacing_mm ", old_spacing, " mm -> ", new_spacing, " mm"));
  for (const EffectInstance& instance : before.effects)
    if (Find(after, EffectTitle(*instance.effect)) == nullptr)
      lines.push_back(
          absl::StrCat(EffectTitle(*instance.effect), " removed", AllValues(instance, before.fingers)));
  for (const EffectInstance& instance : after.effects) {
    const EffectInstance* old_instance = Find(before, EffectTitle(*instance.effect));
    if (old_instance == nullptr)
      lines.push_back(
          absl::StrCat(EffectTitle(*instance.effect), " added", AllValues(instance, after.fingers)));
    else
      CompareEffects(*old_instance, before.fingers, instance, after.fingers, &lines);
  }
  const std::vector<std::string> old_order = CommonOrder(before, after);
  const std::vector<std::string> new_order = CommonOrder(after, before);
  if (old_order != new_order)
    lines.push_back(
        absl::StrCat("order: ", absl::StrJoin(old_order, ", "), " -> ", absl::StrJoin(new_order, ", ")));
  // Equal in all that is compared above, and yet another hash: new effects inserted between others.
  if (lines.empty()) lines.push_back("the models differ in the order of their effects");
  return lines;
}

}  // namespace touchstone::model
