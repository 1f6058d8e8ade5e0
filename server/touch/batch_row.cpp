#include "server/touch/batch_row.h"

#include <absl/strings/str_cat.h>

namespace touchstone::touch {

absl::Status SetCovariates(const std::vector<std::string>& names, const CommandedTouch& touch,
                           const std::string& where, int row, effects::TouchBatch* batch) {
  for (const std::string& name : names) {
    const auto value = touch.covariates.find(name);
    if (value == touch.covariates.end())
      return absl::InvalidArgumentError(
          absl::StrCat(where, ".covariates['", name, "'] is missing: a formula of the model uses it"));
    std::vector<double>& values = batch->covariates[name];
    values.resize(batch->size());
    values[row] = value->second;
  }
  return absl::OkStatus();
}

}  // namespace touchstone::touch
