// Mistakes about the objects: their names, their meshes, where their origins are. They depend on what is known of the
// objects, so they are found by looking at each object alone.
#pragma once

#include <vector>

#include "server/diagnosis/checks/trial.h"

namespace touchstone::diagnosis::checks {

// Objects whose touches fit the mesh of another name by far better than their own: every mesh of the input is tried,
// those that the set does not name too. None, or one mistake with all of them.
std::vector<Mistake> MisnamedObjects(const Trial& trial, const TrialResult& before);

// The origin at a corner, a side or the middle of the object's bounding box instead of at the mesh's origin.
std::vector<Mistake> OriginsOfBoundingBox(const Trial& trial);

// Objects that stood higher or lower than told by more than any fixture is off, from
// CheckRules::min_offset_m on. The size is fitted.
std::vector<Mistake> OffsetOrigins(const Trial& trial, const TrialResult& before);

}  // namespace touchstone::diagnosis::checks
