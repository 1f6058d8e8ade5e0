// What a dry run would touch, for the page to draw on the object: every touch in the order in which the rig would make it, with the
// path of its tip, and those that the rig cannot make.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "client/source/plans/rig_plan.h"

namespace touchstone::workbench {

// By object, as the source lists it.
using ObjectsOfSource = std::map<std::string, v1::Object>;

// `checks` has one for each row, with its path. Object frame, mm:
// {"touches": all, "objects": [{"name", "low_mm", "high_mm", "vertices_mm", "triangles"}],
//  "setups": [{"object": entry, "up_face", "touches": [TOUCH ..]}], "impossible": [TOUCH with "object": entry and "reason" ..]}, TOUCH:
// {"touch", "target_mm", "approach", "lateral", "standoff_mm", "path_mm": x y z of each point in turn}. At most 2000 touches, evenly.
// A mesh is there where it is one of the built-in shapes; low_mm and high_mm are the object's box.
nlohmann::json DrawTouches(const std::vector<client::PlannedRow>& rows,
                           const std::vector<v1::TouchCheck>& checks,
                           const std::vector<client::RigGroup>& setups, const ObjectsOfSource& objects);

}  // namespace touchstone::workbench
