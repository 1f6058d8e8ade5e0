#include "client/workbench_server/model_edit.h"

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <vector>

#include "client/source/lab_units.h"
#include "server/base/status.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

absl::StatusOr<model::Model> Parse(const std::string& yaml, const char* origin) {
  return model::ParseModel(yaml, origin, effects::Catalogue());
}

auto Find(model::Model* model, const std::string& name) {
  return std::find_if(model->effects.begin(), model->effects.end(),
                      [&](const model::EffectInstance& one) { return one.effect->name == name; });
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

absl::StatusOr<model::Model> Changed(const json& request) {
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, Parse(request.at("yaml"), "the model"));
  const std::string change = request.at("change");
  if (change == "none") return model;
  const std::string effect = request.at("effect");
  if (change == "remove") return model::RemoveEffect(model, effect);
  if (change == "take") {
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model from, Parse(request.at("from"), "the improved model"));
    TOUCHSTONE_RETURN_IF_ERROR(Take(effect, std::move(from), &model));
    return model;
  }
  if (change != "set")
    return absl::InvalidArgumentError(
        absl::StrCat("change = '", change, "'; none, take, set or remove was expected"));
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
    // Formulas and lookups are more than their values.
    const bool editable = effects::Catalogue().Find(one.effect->name) != nullptr;
    effects.push_back({{"name", one.effect->name},
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
    TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model, Changed(parsed));
    const std::string yaml = model::FormatModel(model);
    TOUCHSTONE_RETURN_IF_ERROR(Parse(yaml, "the changed model").status());
    return json{{"yaml", yaml}, {"hash", model.Hash()}, {"name", model.name}, {"effects", EffectsJson(model)}}
        .dump(-1, ' ', false, json::error_handler_t::replace);
  } catch (const json::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat("a change of a model: ", error.what()));
  }
}

}  // namespace touchstone::workbench
