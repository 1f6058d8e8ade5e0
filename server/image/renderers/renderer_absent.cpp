// What stands in for renderer_egl.cpp in a build without EGL (TOUCHSTONE_EGL=OFF).
#include "server/image/renderers/renderer.h"

namespace touchstone::image {

absl::StatusOr<std::shared_ptr<Renderer>> CreateEglRenderer(int /*device*/) {
  return absl::UnimplementedError(
      "this build has no EGL renderer; ask for the cpu renderer, or build with -DTOUCHSTONE_EGL=ON "
      "(Debian: libegl-dev and libepoxy-dev)");
}

std::vector<EglDevice> ListEglDevices() {
  return {};
}

}  // namespace touchstone::image
