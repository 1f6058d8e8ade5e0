#include "client/workbench_server/formula_words.h"

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/effects/formula/formula.h"
#include "server/effects/formula/formula_program.h"
#include "server/effects/formula/pixel_variables.h"

namespace touchstone::workbench {
namespace {

using Json = nlohmann::ordered_json;

constexpr Unit kUnitsOfParameters[] = {Unit::kNone,
                                       Unit::kMillimetre,
                                       Unit::kDegree,
                                       Unit::kMicrosecond,
                                       Unit::kSecond,
                                       Unit::kMillimetrePerSecond,
                                       Unit::kMillimetrePerSecondSquared,
                                       Unit::kMillimetrePerHour,
                                       Unit::kPerMetre,
                                       Unit::kPixel,
                                       Unit::kGreyLevel};

}  // namespace

Json FormulaWords() {
  Json variables = Json::array();
  for (const effects::FormulaVariable& variable : effects::FormulaVariables())
    variables.push_back({{"name", variable.name},
                         {"unit", variable.unit},
                         {"since_stage", model::StageName(variable.since)},
                         {"meaning", variable.meaning}});
  Json pixel_variables = Json::array();
  for (const effects::PixelVariable& variable : effects::PixelVariables())
    pixel_variables.push_back(
        {{"name", variable.name}, {"unit", variable.unit}, {"meaning", variable.meaning}});
  Json functions = Json::array();
  for (const effects::FormulaWord& word : effects::FormulaFunctions())
    functions.push_back({{"name", word.name}, {"usage", word.usage}, {"meaning", word.meaning}});
  Json constants = Json::array();
  for (const effects::FormulaWord& word : effects::FormulaConstants())
    constants.push_back({{"name", word.name}, {"meaning", word.meaning}});
  Json units = Json::array();
  for (const Unit unit : kUnitsOfParameters) units.push_back(std::string(UnitSymbol(unit)));
  return {{"variables", variables},
          {"pixel_variables", pixel_variables},
          {"functions", functions},
          {"constants", constants},
          {"units", units}};
}

absl::StatusOr<std::string> NamesInFormula(const std::string& request) {
  const Json parsed = Json::parse(request, nullptr, /*allow_exceptions=*/false);
  if (!parsed.is_object() || !parsed.contains("expression") || !parsed["expression"].is_string())
    return absl::InvalidArgumentError("an expression is asked about as JSON, {\"expression\": TEXT}");
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto program,
                              effects::FormulaProgram::Compile(parsed["expression"].get<std::string>()));
  Json names = Json::array();
  for (const effects::UsedName& used : program->names())
    names.push_back({{"name", used.name}, {"character", used.character}});
  return Json{{"names", names}}.dump();
}

}  // namespace touchstone::workbench
