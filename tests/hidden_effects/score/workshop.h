// What the oracle and the product both need of the objects: the same meshes, twice.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/diagnose.h"
#include "tests/hidden_effects/generator/generate.h"

namespace touchstone::hidden {

struct Workshop {
  std::vector<std::shared_ptr<const Solid>> solids;                // lat00 .. lat20
  std::map<std::string, std::shared_ptr<const Surface>> surfaces;  // the same for the product
};

// Reads lat*.off from a folder; makes the shapes anew where they are missing. Dies if neither goes.
Workshop OpenWorkshop(const std::string& mesh_folder);

// A set as the product's diagnosis takes it.
absl::StatusOr<DiagnosisInput> InputFor(const Set& set, const Workshop& workshop);
absl::StatusOr<DiagnosisInput> InputFor(const std::string& csv, const std::string& model_yaml,
                                        const Workshop& workshop);

// How far the predictions of a model are from the oracle's exact times, RMS in us (DESIGN 8, without noise).
absl::StatusOr<double> ExactRmseUs(const Set& set, const std::string& model_yaml, const Workshop& workshop);

}  // namespace touchstone::hidden
