// What is hidden in the emulated rig, as people write it on the command line: the names and units of
// the catalogue (touchstone effects).
#pragma once

#include <string>
#include <vector>

#include "tests/hidden_effects/generator/scenario.h"

namespace touchstone::rig {

// "tip_radius.radius_mm=2", "channel_latency.latency_us=2000,-2000,0",
// "object_pose.translation_mm=0.5,0,0.2", for one object alone "object_pose.lat20.rotation_deg=0,0,1"; every
// effect of the catalogue but formula. Parameters of one effect may come one after the other; those not given
// change nothing (surface_error.length_mm: 20). Into scenario->hidden. Throws std::invalid_argument that
// names what is wrong and what would be right.
void Hide(const std::string& assignment, hidden::Scenario* scenario);

// "lead_screw=0.3,4": physics of no catalogue (generator/unlisted.h), its k_mm and its second number.
void AddUnlisted(const std::string& assignment, hidden::Scenario* scenario);

// Objects by "NAME=FILE" (a mesh file in mm); none: the five built-in supershapes with about so many
// triangles, the same meshes as the virtual source's.
std::vector<std::shared_ptr<const hidden::Solid>> ReadObjects(const std::vector<std::string>& meshes,
                                                              int triangles);

}  // namespace touchstone::rig
