#include "server/model/model.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "server/base/text/text.h"
#include "server/model/fields/lookup_fields.h"
#include "server/model/fields/user_term_fields.h"
#include "server/model/parameter_values.h"
#include "server/model/surface_map_file.h"

namespace touchstone::model {
namespace {

void AppendValues(const EffectInstance& instance, const std::vector<double>& values, int fingers,
                  std::string* text) {
  const Effect& effect = *instance.effect;
  for (size_t i = 0; i < effect.parameters.size(); ++i) {
    const ParameterInfo& parameter = effect.parameters[i];
    const absl::Span<const double> own =
        absl::MakeConstSpan(values).subspan(ValueOffset(effect, i, fingers), parameter.Count(fingers));
    absl::StrAppend(text, parameter.name, " ", FileNumbers(parameter, own), "\n");
  }
}

// Length first, so that no name or expression can be taken for what follows it.
void AppendText(absl::string_view key, const std::string& value, std::string* text) {
  absl::StrAppend(text, key, " ", value.size(), ":", value, "\n");
}

}  // namespace

absl::Span<const double> EffectInstance::ValuesFor(const std::string& object) const {
  const auto own = object_values.find(object);
  return own == object_values.end() ? values : own->second;
}

std::string Model::Hash() const {
  std::string text = absl::StrCat("touchstone model/1\nfingers ", fingers, "\nspacing_mm ",
                                  FileNumber(Unit::kMillimetre, spacing_m), "\n");
  for (const EffectInstance& instance : effects) {
    const Effect& effect = *instance.effect;
    absl::StrAppend(&text, "effect ", effect.name, "\nscope ", instance.per_object ? "object" : "rig", "\n");
    if (effect.formula) {
      AppendText("name", effect.formula->name, &text);
      AppendText("expression", effect.formula->expression, &text);
      absl::StrAppend(&text, "adds ", AddsName(*effect.formula), "\nstage ", StageName(effect.stage), "\n");
      for (const ParameterInfo& parameter : effect.parameters)
        absl::StrAppend(&text, "bounds ", parameter.name, " ", UnitSymbol(parameter.unit), " ",
                        ShortestNumber(parameter.lower), " ", ShortestNumber(parameter.upper), "\n");
    }
    if (effect.lookup) AppendText("lookup", LookupDefinition(*effect.lookup), &text);
    if (effect.surface_map) AppendText("surface_map", FormatSurfaceMap(effect.surface_map->objects), &text);
    AppendValues(instance, instance.values, fingers, &text);
    for (const auto& [object, values] : instance.object_values) {
      AppendText("object", object, &text);
      AppendValues(instance, values, fingers, &text);
    }
  }
  return Sha256Hex(text);
}

Model DeterministicPart(const Model& model) {
  Model part = model;
  part.effects.erase(std::remove_if(part.effects.begin(), part.effects.end(),
                                    [](const EffectInstance& instance) { return instance.effect->random(); }),
                     part.effects.end());
  return part;
}

Model NominalModel(int fingers, double spacing_m) {
  Model model;
  model.name = "nominal";
  model.fingers = fingers;
  model.spacing_m = spacing_m;
  return model;
}

}  // namespace touchstone::model
