#include "server/model/fields/formula_fields.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::model {
namespace {

absl::StatusOr<double> NumberField(const FormulaFields::Parameter& parameter, const char* field) {
  const auto text = parameter.fields.find(field);
  if (text == parameter.fields.end())
    return MissingField(absl::StrCat("formula parameter ", parameter.name), field,
                        "{value: 0, unit: mm, min: -1, max: 1}");
  absl::StatusOr<double> value = ParseNumber(text->second);
  if (value.ok()) return value;
  return absl::InvalidArgumentError(
      absl::StrCat("formula parameter ", parameter.name, ", ", field, ": ", value.status().message()));
}

absl::StatusOr<Unit> UnitField(const FormulaFields::Parameter& parameter) {
  const auto text = parameter.fields.find("unit");
  if (text == parameter.fields.end())
    return MissingField(absl::StrCat("formula parameter ", parameter.name), "unit",
                        "unit: mm, or unit: 1 for a ratio");
  Unit unit = Unit::kNone;
  if (text->second == "1" || UnitFromSymbol(text->second, &unit)) return unit;
  return absl::InvalidArgumentError(
      absl::StrCat("formula parameter ", parameter.name, ": unknown unit '", text->second,
                   "'; known: mm, deg, us, s, mm/s, mm/s^2, mm/h, 1/m, px, grey, and 1 for anything else"));
}

}  // namespace

absl::StatusOr<FormulaSpec> FormulaFields::ToSpec() const {
  FormulaSpec spec;
  TOUCHSTONE_RETURN_IF_ERROR(FillTerm("formula", "lead_screw", &spec));
  if (expression.empty()) return MissingField("formula", "expression", "expression: \"k * finger\"");
  spec.expression = expression;
  for (const Parameter& parameter : parameters) {
    ParameterInfo info;
    info.name = parameter.name;
    TOUCHSTONE_ASSIGN_OR_RETURN(const double value, NumberField(parameter, "value"));
    TOUCHSTONE_ASSIGN_OR_RETURN(info.unit, UnitField(parameter));
    TOUCHSTONE_ASSIGN_OR_RETURN(info.lower, NumberField(parameter, "min"));
    TOUCHSTONE_ASSIGN_OR_RETURN(info.upper, NumberField(parameter, "max"));
    info.meaning = absl::StrCat("Parameter of the formula '", name, "'.");
    spec.parameters.push_back(std::move(info));
    spec.values.push_back(value);
  }
  return spec;
}

}  // namespace touchstone::model
