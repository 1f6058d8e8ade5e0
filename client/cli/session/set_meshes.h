// The mesh files that go with a set.
#pragma once

#include <string>
#include <vector>

#include "client/cli/common/common.h"

namespace touchstone::cli {

// The meshes that the set's objects need, of those that the options name, and what --mesh names beside.
// `further`: of --mesh-dir also those that the set does not name, up to a bound.
absl::StatusOr<std::vector<source::MeshSpec>> MeshesOf(const Cli& cli,
                                                       const std::vector<std::string>& objects, bool further);

}  // namespace touchstone::cli
