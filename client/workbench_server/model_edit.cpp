#include "client/workbench_server/model_edit.h"

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <vector>

#include "client/source/dataset/lab_units.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"
#include "server/model/own_name.h"
#include "server/model/provenance.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

absl::StatusOr<model::Model> Parse(const std::string& yaml, const char* origin) {
  return model::ParseModel(yaml, origin, effects::Catalogue());
}

auto Find(model::Model* model, const std::string& name) {
  return std::find_if(model->effects.begin(), model->effects.end(),
                      [&](const model::EffectInstance& one) { return model::OwnName(*one.effect) == name; });
}

// The effect of `from` in place of the one in `model`, or at its end.
absl::Status Take(const std::string& name, model::Model from, model::Model* model) {
  const auto taken = Find(&from, name);
  if (taken == from.effects.end())
    return absl::NotFoundError(absl::StrCat("the model to take from has no effect '", name, "'"));
  const auto there = Find(model, name);
  if (there == model->effects.end())
    model->effects.push_back(*taken);
  else
    *there = *taken;
  return absl::OkStatus();
}

// New values of a formula, which keeps its expression: "k=0.3" in the unit of its parameter.
absl::Status SetFormula(const std::vector<std::string>& assignments, model::EffectInstance* formula) {
  for (const std::string& assignment : assignments) {
    const size_t equals = assignment.find('=');
    const std::string name = assignment.substr(0, equals);
    const auto& parameters = formula->effect->parameters;
    const auto found = std::find_if(parameters.begin(), parameters.end(),
                                    [&](const model::ParameterInfo& one) { return one.name == name; });
    if (equals == std::string::npos || found == parameters.end())
      return absl::InvalidArgumentError(absl::StrCat(
          "'", assignment, "': the formula '", model::OwnName(*formula->effect), "' has no such parameter"));
    TOUCHSTONE_ASSIGN_OR_RETURN(const double value, ParseNumber(assignment.substr(equals + 1)));
    formula->values[found - parameters.begin()] = ToSi(found->unit, value);
  }
  return absl::OkStatus();
}

// What was taken from a model was fitted to what that was; errors are those of the whole.
absl::StatusOr<std::string> TextOfTaken(const model::Model& model, const std::string& from) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model whole, Parse(from, "the improved model"));
  if (model.Hash() == whole.Hash()) return from;
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Provenance provenance,
                              model::ReadProvenance(from, "the improved model"));
  for (model::UsedSet& set : provenance.fitted_to) set.unit.clear();
  return model::FormatModel(model) + model::FormatProvenance(provenance);
}

absl::StatusOr<model::Model> Changed(const json& request) {
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, Parse(request.at("yaml"), "the model"));
  const std::string change = request.at("change");
  if (change == "none") return model;
  if (change == "formula")
    return model::AddEffect(model, "formula", request.at("assignments").get<std::vector<std::string>>(),
                            effects::Catalogue());
  const std::string effect = request.at("effect");
  if (change == "remove") return model::RemoveEffect(model, effect);
  if (change == "take") {
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model from, Parse(request.at("from"), "the improved model"));
    TOUCHSTONE_RETURN_IF_ERROR(Take(effect, std::move(from), &model));
    return model;
  }
  if (change != "set")
    return absl::InvalidArgumentError(
        absl::StrCat("change = '", change, "'; none, take, set, formula or remove was expected"));
  if (const auto there = Find(&model, effect); there != model.effects.end() && there->effect->formula) {
    TOUCHSTONE_RETURN_IF_ERROR(
        SetFormula(request.at("assignments").get<std::vector<std::string>>(), &*there));
    return model;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(
      model::Model alone,
      model::AddEffect(model::NominalModel(model.fingers, model.spacing_m), effect,
                       request.at("assignments").get<std::vector<std::string>>(), effects::Catalogue()));
  TOUCHSTONE_RETURN_IF_ERROR(Take(effect, std::move(alone), &model));
  return model;
}

json EffectsJson(const model::Model& model) {
  json effects = json::array();
  for (const model::EffectInstance& one : model.effects) {
    json parameters = json::array();
    size_t at = 0;
    for (const model::ParameterInfo& parameter : one.effect->parameters) {
      json values = json::array();
      for (int i = 0; i < parameter.Count(model.fingers) && at < one.values.size(); ++i)
        values.push_back(client::LabNumber(parameter.unit, one.values[at++]));
      parameters.push_back({{"name", parameter.name},
                            {"unit", std::string(UnitSymbol(parameter.unit))},
                            {"lower", parameter.lower},
                            {"upper", parameter.upper},
                            {"neutral", parameter.neutral},
                            {"typical", parameter.typical},
                            {"meaning", parameter.meaning},
                            {"values", values}});
    }
    const bool editable = one.effect->formula || (!one.effect->lookup && !one.effect->surface_map);
    effects.push_back({{"name", model::OwnName(*one.effect)},
                       {"formula", one.effect->formula ? one.effect->formula->expression : ""},
                       {"per_object", one.per_object},
                       {"editable", editable},
                       {"parameters", parameters}});
  }
  return effects;
}

}  // namespace

absl::StatusOr<std::string> ChangeModel(const std::string& request) {
  const json parsed = json::parse(request, nullptr, /*allow_exceptions=*/false);
  if (!parsed.is_object()) return absl::InvalidArgumentError("a change of a model is a JSON object");
  try {
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, Changed(parsed));
    std::string yaml = model::FormatModel(model);
    if (parsed.at("change") == "take") {
      TOUCHSTONE_ASSIGN_OR_RETURN(yaml, TextOfTaken(model, parsed.at("from")));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(model, Parse(yaml, "the changed model"));
    return json{{"yaml", yaml}, {"hash", model.Hash()}, {"name", model.name}, {"effects", EffectsJson(model)}}
        .dump(-1, ' ', false, json::error_handler_t::replace);
  } catch (const json::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat("a change of a model: ", error.what()));
  }
}

}  // namespace touchstone::workbench
