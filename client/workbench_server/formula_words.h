// What an expression of a formula may use, as data: for the page and for `touchstone effects formula --json`.
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace touchstone::workbench {

// {"variables": [{"name", "unit", "since_stage", "meaning"}], "pixel_variables", "functions", "constants", "units"}, units those
// that a parameter may have.
nlohmann::ordered_json FormulaWords();

// The names in an expression that are no functions or constants, in the order of their first use: `request` is JSON
// {"expression"}, the answer {"names": [{"name", "character"}]}, characters from 1. INVALID_ARGUMENT "character 7: ..." says
// what is wrong and where.
absl::StatusOr<std::string> NamesInFormula(const std::string& request);

}  // namespace touchstone::workbench
