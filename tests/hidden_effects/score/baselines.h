// Baselines: what common methods make of the same sets.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/diagnose.h"

namespace touchstone::hidden {

struct Baselines {
  std::vector<std::string> bic;        // forward selection over the catalogue by BIC: its choices, in order
  std::vector<std::string> rmse_drop;  // effects are added as long as the RMSE falls by more than 2 %
  bool gp_detects = false;             // a Gaussian process over each surface explains something (3 nats)
};

// All linear: derivatives by finite differences, at the nominal model.
absl::StatusOr<Baselines> RunBaselines(const diagnosis::DiagnosisInput& input);

}  // namespace touchstone::hidden
