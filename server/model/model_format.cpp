// A model as the file that a person would have written.
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <algorithm>

#include "server/base/text/text.h"
#include "server/model/fields/user_term_fields.h"
#include "server/model/finger_name.h"
#include "server/model/model.h"
#include "server/model/parameter_values.h"
#include "server/model/surface_map_file.h"
#include "server/model/yaml/yaml_text.h"

namespace touchstone::model {
namespace {

// "radius_mm: 1.5", one per parameter.
std::vector<std::string> Entries(const Effect& effect, const std::vector<double>& values, int fingers) {
  std::vector<std::string> entries;
  for (size_t i = 0; i < effect.parameters.size(); ++i) {
    const ParameterInfo& parameter = effect.parameters[i];
    const absl::Span<const double> own =
        absl::MakeConstSpan(values).subspan(ValueOffset(effect, i, fingers), parameter.Count(fingers));
    entries.push_back(absl::StrCat(parameter.name, ": ", FileNumbers(parameter, own)));
  }
  return entries;
}

void AppendObjects(const EffectInstance& instance, int fingers, std::string* text) {
  if (instance.object_values.empty()) return;
  absl::StrAppend(text, "      objects:\n");
  for (const auto& [object, values] : instance.object_values)
    absl::StrAppend(text, "        ", YamlText(object), ": {",
                    absl::StrJoin(Entries(*instance.effect, values, fingers), ", "), "}\n");
}

void AppendFormula(const EffectInstance& instance, int fingers, std::string* text) {
  const Effect& effect = *instance.effect;
  const FormulaSpec& spec = *effect.formula;
  absl::StrAppend(text, "  - formula:\n      name: ", YamlText(spec.name), "\n");
  if (instance.per_object) absl::StrAppend(text, "      scope: object\n");
  absl::StrAppend(text, "      adds: ", AddsName(spec), "\n");
  if (spec.stage != DefaultStage(spec)) absl::StrAppend(text, "      stage: ", StageName(spec.stage), "\n");
  absl::StrAppend(text, "      expression: ", QuotedYamlText(spec.expression), "\n");
  if (!effect.parameters.empty()) absl::StrAppend(text, "      parameters:\n");
  for (size_t i = 0; i < effect.parameters.size(); ++i) {
    const ParameterInfo& parameter = effect.parameters[i];
    const absl::string_view symbol = UnitSymbol(parameter.unit);
    absl::StrAppend(text, "        ", parameter.name,
                    ": {value: ", FileNumber(parameter.unit, instance.values[i]),
                    ", unit: ", symbol.empty() ? "1" : symbol, ", min: ", ShortestNumber(parameter.lower),
                    ", max: ", ShortestNumber(parameter.upper), "}\n");
  }
  AppendObjects(instance, fingers, text);
}

std::string NumberList(const std::vector<double>& numbers) {
  return absl::StrCat(
      "[", absl::StrJoin(numbers, ", ", [](std::string* out, double x) { *out += ShortestNumber(x); }), "]");
}

void AppendLookup(const LookupSpec& spec, std::string* text) {
  absl::StrAppend(text, "  - lookup:\n      name: ", YamlText(spec.name), "\n      adds: ", AddsName(spec),
                  "\n");
  if (spec.stage != DefaultStage(spec)) absl::StrAppend(text, "      stage: ", StageName(spec.stage), "\n");
  absl::StrAppend(text, "      covariate: ", YamlText(spec.covariate),
                  "\n      knots: ", NumberList(spec.knots), "\n");
  if (spec.values.size() == 1) {
    absl::StrAppend(text, "      values: ", NumberList(spec.values[0]), "\n");
    return;
  }
  absl::StrAppend(text, "      values:\n");
  const int fingers = static_cast<int>(spec.values.size());
  for (int i = 0; i < fingers; ++i)
    absl::StrAppend(text, "        ", YamlText(FingerName(i, fingers)), ": ", NumberList(spec.values[i]),
                    "\n");
}

void AppendSurfaceMap(const SurfaceMapSpec& spec, FileContent content, std::string* text) {
  if (content == FileContent::kBeside) {
    absl::StrAppend(text, "  - surface_map: {file: ", YamlText(spec.file), "}\n");
    return;
  }
  absl::StrAppend(text, "  - surface_map:\n      file: ", YamlText(spec.file), "\n      csv: |\n");
  for (const absl::string_view line : absl::StrSplit(FormatSurfaceMap(spec.objects), '\n', absl::SkipEmpty()))
    absl::StrAppend(text, "        ", line, "\n");
}

}  // namespace

std::string FormatModel(const Model& model, FileContent content) {
  std::string text = absl::StrCat("touchstone: model/1\nname: ", YamlText(model.name),
                                  "\nend_effector: {fingers: ", model.fingers,
                                  ", spacing_mm: ", FileNumber(Unit::kMillimetre, model.spacing_m), "}\n",
                                  model.effects.empty() ? "effects: []\n" : "effects:\n");
  for (const EffectInstance& instance : model.effects) {
    const Effect& effect = *instance.effect;
    if (effect.formula) {
      AppendFormula(instance, model.fingers, &text);
      continue;
    }
    if (effect.lookup) {
      AppendLookup(*effect.lookup, &text);
      continue;
    }
    if (effect.surface_map) {
      AppendSurfaceMap(*effect.surface_map, content, &text);
      continue;
    }
    std::vector<std::string> entries = Entries(effect, instance.values, model.fingers);
    if (instance.per_object && !effect.always_per_object) entries.insert(entries.begin(), "scope: object");
    if (instance.object_values.empty()) {
      absl::StrAppend(&text, "  - ", effect.name, ": {", absl::StrJoin(entries, ", "), "}\n");
      continue;
    }
    absl::StrAppend(&text, "  - ", effect.name, ":\n");
    for (const std::string& entry : entries) absl::StrAppend(&text, "      ", entry, "\n");
    AppendObjects(instance, model.fingers, &text);
  }
  return text;
}

}  // namespace touchstone::model
