// Changes of a model on the page, by the functions that `touchstone model` calls.
#pragma once

#include <string>

#include <absl/status/statusor.h>

namespace touchstone::workbench {

// `request` is JSON: {"yaml": MODEL, "change": ..., "effect": NAME, ...} with the change
//   "none"             nothing
//   "take"             the effect as the model "from" has it, for instance a report's improved model. Once nothing is left to
//                      take the answer is "from", byte for byte; before, it says the sets that "from" was fitted to
//   "set"              the effect with "assignments", ["radius_mm=2.5"], in place of the one that is there
//                      of a formula the values alone, ["k=0.3"]
//   "formula"          a formula of "assignments", as `touchstone model add MODEL formula` takes them, at the end
//   "remove"           the effect; a formula and a lookup by their own names
// The answer: {"yaml", "hash", "name", "effects": [{"name", "parameters": [{"name", "unit", "values": [..]}]}]}, values in the
// units of files. INVALID_ARGUMENT says what is wrong with the request or the model.
absl::StatusOr<std::string> ChangeModel(const std::string& request);

}  // namespace touchstone::workbench
