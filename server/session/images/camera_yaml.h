// camera.yaml of an image set (format: measurement_files.md): the nominal lens of its pictures.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/session/images/image_set.h"

namespace touchstone::session {

// Errors name origin, line, column, the key and what was expected.
absl::StatusOr<CameraIntrinsics> ParseCameraYaml(const std::string& text, const std::string& origin);

// Reads back to the same numbers; distortion only where there is some.
std::string FormatCameraYaml(const CameraIntrinsics& camera);

}  // namespace touchstone::session
