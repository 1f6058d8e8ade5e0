#include "client/cli/session/image_set_fix.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/image/encoding/encode.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

absl::Status BadValue(absl::string_view option, absl::string_view text, absl::string_view expected) {
  return absl::InvalidArgumentError(absl::StrCat(option, ": '", text, "': ", expected, " expected"));
}

absl::Status ReadImageNumbers(const std::string& text, session::ImageSetFix* fix) {
  if (text.empty()) return absl::OkStatus();
  for (const std::string& range : std::vector<std::string>(absl::StrSplit(text, ','))) {
    const std::vector<std::string> ends = absl::StrSplit(range, '-');
    uint64_t first = 0, last = 0;
    if (ends.size() > 2 || !absl::SimpleAtoi(ends.front(), &first) || !absl::SimpleAtoi(ends.back(), &last) ||
        last < first)
      return BadValue("--images", range,
                      "an image's number, or the first and the last of several (12-20), was");
    fix->images.emplace_back(first, last);
  }
  return absl::OkStatus();
}

absl::Status ReadUp(const std::string& text, session::ImageSetFix* fix) {
  if (text.empty()) return absl::OkStatus();
  const std::vector<std::string> numbers = absl::StrSplit(text, ',');
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  bool good = numbers.size() == 3;
  for (size_t axis = 0; good && axis < 3; ++axis)
    good = absl::SimpleAtod(numbers[axis], &up[axis]) && std::isfinite(up[axis]);
  if (!good || up.norm() < 1e-9) return BadValue("--up", text, "a direction x,y,z (0,0,1) was");
  fix->up = up;
  return absl::OkStatus();
}

absl::Status ReadExchange(const std::string& text, session::ImageSetFix* fix) {
  if (text.empty()) return absl::OkStatus();
  const std::vector<std::string> images = absl::StrSplit(text, ',');
  uint64_t one = 0, other = 0;
  if (images.size() != 2 || !absl::SimpleAtoi(images[0], &one) || !absl::SimpleAtoi(images[1], &other))
    return BadValue("--exchange", text, "the numbers of two images (3,5) was");
  fix->exchange = {one, other};
  return absl::OkStatus();
}

absl::Status ReadDrop(const std::string& text, session::ImageSetFix* fix) {
  if (text.empty()) return absl::OkStatus();
  for (const std::string& image : std::vector<std::string>(absl::StrSplit(text, ',')))
    if (!absl::SimpleAtoi(image, &fix->drop.emplace_back()))
      return BadValue("--drop-images", image, "an image's number was");
  return absl::OkStatus();
}

absl::Status ReadImageFix(const ImageSetFixOptions& options, session::ImageSetFix* fix) {
  TOUCHSTONE_RETURN_IF_ERROR(ReadImageNumbers(options.images, fix));
  TOUCHSTONE_RETURN_IF_ERROR(ReadUp(options.up, fix));
  if (options.rotate_deg % 90 != 0 || options.rotate_deg < 0 || options.rotate_deg > 270)
    return BadValue("--rotate", absl::StrCat(options.rotate_deg), "90, 180 or 270 was");
  fix->rotate_deg = options.rotate_deg;
  if (options.mirror == "left-right")
    fix->mirror = session::ImageSetFix::Mirror::kLeftRight;
  else if (options.mirror == "up-down")
    fix->mirror = session::ImageSetFix::Mirror::kUpDown;
  else if (!options.mirror.empty())
    return BadValue("--mirror", options.mirror, "left-right or up-down was");
  for (const auto& [option, factor] : {std::pair<const char*, double>{"--scale-camera", options.scale_camera},
                                       {"--focal-factor", options.focal_factor},
                                       {"--scale-lengths", fix->scale_lengths}})
    if (!(factor > 0 && std::isfinite(factor)))
      return BadValue(option, ShortestNumber(factor), "a factor above 0 was");
  fix->swap_channels = options.swap_channels;
  fix->swap_eye_at = options.swap_eye_at;
  fix->reverse_up = options.reverse_up;
  TOUCHSTONE_RETURN_IF_ERROR(ReadExchange(options.exchange, fix));
  TOUCHSTONE_RETURN_IF_ERROR(ReadDrop(options.drop, fix));
  fix->scale_camera = options.scale_camera;
  fix->scale_focal = options.focal_factor;
  if (fix->empty())
    return absl::InvalidArgumentError(
        "nothing to fix was named; touchstone diagnose names the options where it finds a mistake");
  return absl::OkStatus();
}

}  // namespace

void AddImageSetFixOptions(CLI::App* command, ImageSetFixOptions* options) {
  const char* const group = "Photographs";
  command
      ->add_option(
          "--images", options->images,
          "Fix these pictures alone, by their numbers; for --rotate, --mirror, --swap-channels and poses. "
          "Default: all")
      ->type_name("A-B,...")
      ->group(group);
  command->add_option("--rotate", options->rotate_deg, "Turn the pictures clockwise by 90, 180 or 270 deg")
      ->type_name("DEG")
      ->group(group);
  command
      ->add_option("--mirror", options->mirror, "Mirror the pictures: left-right or up-down (after --rotate)")
      ->type_name("HOW")
      ->group(group);
  command->add_flag("--swap-channels", options->swap_channels, "Exchange red and blue")->group(group);
  command
      ->add_option("--scale-camera", options->scale_camera,
                   "Multiply fx, fy, cx and cy of camera.yaml (it was made for pictures of another size)")
      ->type_name("F")
      ->group(group);
  command->add_option("--focal-factor", options->focal_factor, "Multiply fx and fy of camera.yaml")
      ->type_name("F")
      ->group(group);
  command->add_flag("--swap-eye-at", options->swap_eye_at, "Exchange eye and at")->group(group);
  command->add_flag("--reverse-up", options->reverse_up, "Turn up around in every picture")->group(group);
  command->add_option("--drop-images", options->drop, "Leave these pictures out, by their numbers")
      ->type_name("A,B,...")
      ->group(group);
  command
      ->add_option("--exchange", options->exchange,
                   "Exchange two pictures, by their numbers: each gets the other's row")
      ->type_name("A,B")
      ->group(group);
  command->add_option("--up", options->up, "The camera's up in every picture")
      ->type_name("X,Y,Z")
      ->group(group);
}

absl::Status FixImageSetFolder(const Cli& cli, const std::string& folder, const std::string& output,
                               const ImageSetFixOptions& options, session::ImageSetFix fix) {
  TOUCHSTONE_RETURN_IF_ERROR(ReadImageFix(options, &fix));
  if (output == "-")
    return absl::InvalidArgumentError("-o: a folder was expected: pictures cannot go to stdout");
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::ImageSetFiles files, session::ReadImageSetFiles(folder));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::ImageSet set, session::ParseImageSet(files));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::FixedImageSet fixed,
                              session::FixImageSet(set, files.images_csv(), files.camera_yaml(), fix));
  files.set_images_csv(fixed.images_csv);
  files.set_camera_yaml(fixed.camera_yaml);
  const session::CameraIntrinsics& camera = fixed.set.camera;
  for (v1::ImageFile& file : *files.mutable_files()) {
    const auto changed = fixed.changed_pixels.find(file.name());
    if (changed == fixed.changed_pixels.end()) continue;
    const int channels = static_cast<int>(changed->second.size() / (camera.width_px * camera.height_px));
    TOUCHSTONE_ASSIGN_OR_RETURN(*file.mutable_png(), image::EncodePng(changed->second.data(), camera.width_px,
                                                                      camera.height_px, channels));
  }
  // Pictures of rows that were dropped go with them.
  auto* const kept = files.mutable_files();
  kept->erase(std::remove_if(kept->begin(), kept->end(),
                             [&](const v1::ImageFile& file) {
                               return std::none_of(fixed.set.photographs.begin(), fixed.set.photographs.end(),
                                                   [&](const auto& row) { return row.file == file.name(); });
                             }),
              kept->end());
  files.set_origin(output);
  // What is written is read like any other folder: a factor may have taken a number out of its range.
  const absl::StatusOr<session::ImageSet> after = session::ParseImageSet(files);
  if (!after.ok())
    return absl::InvalidArgumentError(
        absl::StrCat("fixed like this it is no image set: ", after.status().message()));
  std::map<std::string, std::string> others;
  if (session::HasTouches(folder)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(others[session::kTouchesCsv],
                                ReadFile((fs::path(folder) / session::kTouchesCsv).string()));
  }
  TOUCHSTONE_RETURN_IF_ERROR(session::WriteImageSetFiles(files, output, others));
  if (!others.empty()) cli.Log("note: touches.csv is copied as it is");
  const size_t dropped = set.size() - after->size();
  cli.LogWritten(output, absl::StrCat(" (", folder, " with ", session::FixOptions(fix), "; ",
                                      Counted(after->size(), "picture", "pictures"),
                                      dropped > 0 ? absl::StrCat(", ", dropped, " dropped") : "", ")"));
  return absl::OkStatus();
}

}  // namespace touchstone::cli
