#include <absl/strings/match.h>

#include "server/gateway/camera/camera.h"

namespace touchstone::gateway::camera {

CameraKind CameraKindOf(const std::string& uri) {
  if (uri.empty()) return CameraKind::kNone;
  if (absl::StartsWith(uri, "folder:")) return CameraKind::kFolder;
  if (absl::StartsWith(uri, "video:")) return CameraKind::kVideo;
  return absl::StrContains(uri, "://") ? CameraKind::kStream : CameraKind::kUvc;
}

}  // namespace touchstone::gateway::camera
