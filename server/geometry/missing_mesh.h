// What is said where an object has no mesh.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

namespace touchstone::geometry {

// NOT_FOUND: "set.csv:2: column object: 'mug' has no mesh ...". `place` is what comes before the name ("set.csv: object "), `missing`
// at least one name, `known` the objects that have a mesh: one of them may be meant.
absl::Status MissingMesh(absl::string_view place, const std::vector<std::string>& missing,
                         const std::vector<std::string>& known);

}  // namespace touchstone::geometry
