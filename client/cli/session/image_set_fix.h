// touchstone session fix FOLDER: fixes a discrete mistake of an image set.
#pragma once

#include <string>

#include "client/cli/common/common.h"
#include "server/session/images/image_set_fix.h"

namespace touchstone::cli {

// What only photographs need, as it stands on the command line.
struct ImageSetFixOptions {
  static constexpr const char* kNames[] = {
      "--images",      "--rotate", "--mirror",     "--swap-channels", "--scale-camera", "--focal-factor",
      "--swap-eye-at", "--up",     "--reverse-up", "--exchange",      "--drop-images"};
  std::string images, mirror, up, exchange, drop;
  int rotate_deg = 0;
  bool swap_channels = false, swap_eye_at = false, reverse_up = false;
  double scale_camera = 1, focal_factor = 1;
};

void AddImageSetFixOptions(CLI::App* command, ImageSetFixOptions* options);

// `fix`: what the options for files and folders alike ask for. Writes a new folder; the old one stays as it is. A
// touches.csv is copied as it is.
absl::Status FixImageSetFolder(const Cli& cli, const std::string& folder, const std::string& output,
                               const ImageSetFixOptions& options, session::ImageSetFix fix);

}  // namespace touchstone::cli
