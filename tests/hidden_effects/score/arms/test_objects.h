// The objects of the scored sets: the same meshes for the oracle and for the diagnosis under test.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/diagnose.h"
#include "tests/hidden_effects/generator/generate.h"

namespace touchstone::hidden {

struct TestObjects {
  std::vector<std::shared_ptr<const Solid>> solids;                          // lat00 .. lat20
  std::map<std::string, std::shared_ptr<const geometry::Surface>> surfaces;  // the same for the diagnosis
};

// Reads lat*.off from a folder; computes the shapes where a file is missing. Aborts if neither works.
TestObjects LoadTestObjects(const std::string& mesh_folder);

// A set as input of the diagnosis.
absl::StatusOr<diagnosis::DiagnosisInput> InputFor(const Set& set, const TestObjects& objects);
absl::StatusOr<diagnosis::DiagnosisInput> InputFor(const std::string& csv, const std::string& model_yaml,
                                                   const TestObjects& objects);

// How far the predictions of a model are from the oracle's exact times, us: the RMSE of
// proto/README.md without noise.
absl::StatusOr<double> ExactRmseUs(const Set& set, const std::string& model_yaml, const TestObjects& objects);

}  // namespace touchstone::hidden
