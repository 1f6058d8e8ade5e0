// The file of a surface map: how the surfaces of objects depart from their meshes, at points of support. Format, and
// what holds between the points: surface_map.md.
#pragma once

#include <map>
#include <string>

#include <absl/status/statusor.h>

#include "server/model/effect.h"

namespace touchstone::model {

inline constexpr int kMaxSurfaceMapPoints = 2000;  // of one object

// Reads the text of a map. Errors name `origin` (usually the path), the line, the column and the value.
absl::StatusOr<std::map<std::string, SurfaceMapObject>> ParseSurfaceMap(const std::string& text,
                                                                        const std::string& origin);

// The text that ParseSurfaceMap reads back to the same numbers: equal maps, equal text.
std::string FormatSurfaceMap(const std::map<std::string, SurfaceMapObject>& objects);

// "departures of 5 objects at 720 points".
std::string SurfaceMapInWords(const SurfaceMapSpec& spec);

}  // namespace touchstone::model
