// Adds an effect to a model from "parameter=value" texts, as the command line gives them.
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/model/fields/formula_fields.h"
#include "server/model/fields/lookup_fields.h"
#include "server/model/model.h"
#include "server/model/own_name.h"
#include "server/model/parameter_values.h"
#include "server/model/surface_map_file.h"

namespace touchstone::model {
namespace {

struct Assignment {
  std::string key;
  std::string value;
};

absl::StatusOr<std::vector<Assignment>> Split(const std::vector<std::string>& texts) {
  std::vector<Assignment> assignments;
  for (const std::string& text : texts) {
    const std::vector<std::string> parts = absl::StrSplit(text, absl::MaxSplits('=', 1));
    if (parts.size() != 2 || parts[0].empty() || parts[1].empty())
      return absl::InvalidArgumentError(absl::StrCat("'", text, "' is not of the form parameter=value"));
    for (const Assignment& earlier : assignments)
      if (earlier.key == parts[0])
        return absl::InvalidArgumentError(absl::StrCat("'", parts[0], "' is given twice"));
    assignments.push_back({parts[0], parts[1]});
  }
  return assignments;
}

// "1.5", "0.25,0,-0.25" or "[0.25, 0, -0.25]".
absl::StatusOr<std::vector<double>> Numbers(const std::string& what, const ParameterInfo& parameter,
                                            absl::string_view text) {
  if (absl::ConsumePrefix(&text, "[") && !absl::ConsumeSuffix(&text, "]"))
    return absl::InvalidArgumentError(absl::StrCat(what, ": ']' is missing at the end of '[", text, "'"));
  std::vector<double> numbers;
  for (const absl::string_view part : absl::StrSplit(text, ',')) {
    const absl::StatusOr<double> number = NumberFromText(parameter, absl::StripAsciiWhitespace(part));
    if (!number.ok()) return absl::InvalidArgumentError(absl::StrCat(what, ": ", number.status().message()));
    numbers.push_back(*number);
  }
  return numbers;
}

absl::Status SetParameter(const Effect& effect, const std::string& name, const std::string& text, int fingers,
                          std::vector<double>* values) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const int index, FindParameter(effect, name));
  const std::string what = absl::StrCat(effect.formula ? effect.formula->name : effect.name, ".", name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> numbers,
                              Numbers(what, effect.parameters[index], text));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> values_si,
                              ValuesFromFile(what, effect.parameters[index], numbers, fingers));
  std::copy(values_si.begin(), values_si.end(), values->begin() + ValueOffset(effect, index, fingers));
  return absl::OkStatus();
}

// "k=0.3" declares k, "k_unit", "k_min" and "k_max" describe it.
absl::StatusOr<std::shared_ptr<const Effect>> FormulaFrom(const std::vector<Assignment>& assignments,
                                                          const EffectCatalogue& catalogue) {
  FormulaFields fields;
  const auto described = [&](const std::string& key) -> std::pair<std::string, std::string> {
    for (const char* field : {"unit", "min", "max"}) {
      const std::string ending = absl::StrCat("_", field);
      if (!absl::EndsWith(key, ending)) continue;
      const std::string parameter = key.substr(0, key.size() - ending.size());
      for (const Assignment& other : assignments)
        if (other.key == parameter) return {parameter, field};
    }
    return {key, "value"};
  };
  for (const auto& [key, value] : assignments) {
    if (key == "name")
      fields.name = value;
    else if (key == "adds")
      fields.adds = value;
    else if (key == "stage")
      fields.stage = value;
    else if (key == "expression")
      fields.expression = value;
    else if (key != "scope" && !absl::StrContains(key, '.')) {
      const auto [name, field] = described(key);
      const auto same = [&, name = name](const FormulaFields::Parameter& p) { return p.name == name; };
      auto parameter = std::find_if(fields.parameters.begin(), fields.parameters.end(), same);
      if (parameter == fields.parameters.end())
        parameter = fields.parameters.insert(parameter, FormulaFields::Parameter{name, {}});
      parameter->fields[field] = value;
    }
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const FormulaSpec spec, fields.ToSpec());
  return catalogue.MakeFormula(spec);
}

// "knots=0,300", "values=0,0.1" for every finger, or "l=0,0.1", "m=...", "r=..." for each.
absl::StatusOr<std::shared_ptr<const Effect>> LookupFrom(const std::vector<Assignment>& assignments,
                                                         int fingers, const EffectCatalogue& catalogue) {
  LookupFields fields;
  for (const auto& [key, value] : assignments) {
    if (key == "name")
      fields.name = value;
    else if (key == "adds")
      fields.adds = value;
    else if (key == "stage")
      fields.stage = value;
    else if (key == "covariate")
      fields.covariate = value;
    else {
      TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> numbers, Numbers("lookup." + key, {}, value));
      if (key == "knots")
        fields.knots = std::move(numbers);
      else
        fields.values[key == "values" ? "" : key] = std::move(numbers);
    }
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const LookupSpec spec, fields.ToSpec(fingers));
  return catalogue.MakeLookup(spec);
}

// "file=better.surface.csv".
absl::StatusOr<std::shared_ptr<const Effect>> SurfaceMapFrom(const std::vector<Assignment>& assignments,
                                                             const EffectCatalogue& catalogue,
                                                             const ModelFileReader& files) {
  if (assignments.size() != 1 || assignments[0].key != "file")
    return absl::InvalidArgumentError(
        "surface_map takes file=FILE and nothing else; the format is in server/model/surface_map.md");
  if (files == nullptr) return absl::InvalidArgumentError("surface_map: no file can be read here");
  SurfaceMapSpec spec;
  spec.file = assignments[0].value;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, files(spec.file));
  TOUCHSTONE_ASSIGN_OR_RETURN(spec.objects, ParseSurfaceMap(text, spec.file));
  return catalogue.MakeSurfaceMap(spec);
}

}  // namespace

absl::StatusOr<Model> AddEffect(const Model& model, const std::string& effect_name,
                                const std::vector<std::string>& texts, const EffectCatalogue& catalogue,
                                const ModelFileReader& files) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Assignment> assignments, Split(texts));
  EffectInstance added;
  added.effect = catalogue.Find(effect_name);
  if (added.effect == nullptr) {
    std::vector<std::string> known;
    for (const auto& effect : catalogue.All()) known.push_back(effect->name);
    return absl::NotFoundError(
        absl::StrCat("unknown effect '", effect_name, "'", DidYouMean(effect_name, known)));
  }
  const bool is_formula = effect_name == "formula";
  if (is_formula) {
    TOUCHSTONE_ASSIGN_OR_RETURN(added.effect, FormulaFrom(assignments, catalogue));
  }
  if (effect_name == "lookup") {
    TOUCHSTONE_ASSIGN_OR_RETURN(added.effect, LookupFrom(assignments, model.fingers, catalogue));
    TOUCHSTONE_RETURN_IF_ERROR(CheckAddition(model, *added.effect));
    Model result = model;
    result.effects.push_back(std::move(added));
    return result;
  }
  if (effect_name == "surface_map") {
    TOUCHSTONE_ASSIGN_OR_RETURN(added.effect, SurfaceMapFrom(assignments, catalogue, files));
    TOUCHSTONE_RETURN_IF_ERROR(CheckAddition(model, *added.effect));
    Model result = model;
    result.effects.push_back(std::move(added));
    return result;
  }
  const Effect& effect = *added.effect;
  TOUCHSTONE_RETURN_IF_ERROR(CheckAddition(model, effect));

  // The scope and the values for all objects first: those of single objects start from them.
  added.per_object = effect.always_per_object;
  added.values = effect.NeutralValues(model.fingers);
  for (const auto& [key, value] : assignments) {
    if (key == "scope") {
      if (value != "object" && value != "rig")
        return absl::InvalidArgumentError(
            absl::StrCat("scope is '", value, "'; it must be 'rig' or 'object'"));
      if (value == "rig" && effect.always_per_object)
        return absl::InvalidArgumentError(
            absl::StrCat(effect.name, " differs from object to object; its scope cannot be 'rig'"));
      added.per_object = value == "object";
    } else if (!is_formula && !absl::StrContains(key, '.')) {
      TOUCHSTONE_RETURN_IF_ERROR(SetParameter(effect, key, value, model.fingers, &added.values));
    }
  }
  // "lat00.radius_mm=1.5": the name of an object may have dots, that of a parameter has none.
  for (const auto& [key, value] : assignments) {
    const size_t dot = key.rfind('.');
    if (dot == std::string::npos) continue;
    if (!added.per_object)
      return absl::InvalidArgumentError(
          absl::StrCat("'", key, "' is for one object; that needs scope=object"));
    const std::string object = key.substr(0, dot);
    if (object.empty())
      return absl::InvalidArgumentError(absl::StrCat("'", key, "' has no object before the dot"));
    std::vector<double>& values = added.object_values.emplace(object, added.values).first->second;
    TOUCHSTONE_RETURN_IF_ERROR(SetParameter(effect, key.substr(dot + 1), value, model.fingers, &values));
  }
  Model result = model;
  result.effects.push_back(std::move(added));
  return result;
}

absl::StatusOr<Model> RemoveEffect(const Model& model, const std::string& name) {
  std::vector<std::string> known;
  for (size_t index = 0; index < model.effects.size(); ++index) {
    const Effect& effect = *model.effects[index].effect;
    const std::string& own = OwnName(effect);
    known.push_back(own);
    if (own != name) continue;
    Model result = model;
    result.effects.erase(result.effects.begin() + static_cast<long>(index));
    return result;
  }
  return absl::NotFoundError(
      known.empty()
          ? absl::StrCat("the model has no effect '", name, "', and no other")
          : absl::StrCat("the model has no effect '", name, "'; it has ", absl::StrJoin(known, ", ")));
}

}  // namespace touchstone::model
