// Discrete mistakes of image sets, fixed: pictures mirrored or turned, poses in another unit or frame, another camera. As
// with measurement files (measurement_fix.h) one transformation serves the check that looks for a mistake and the
// command that fixes the folder.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>
#include <Eigen/Core>

#include "server/session/images/image_set.h"

namespace touchstone::session {

// What is wrong with a set, said as what it should have been. Done in the order of the fields.
struct ImageSetFix {
  enum class Mirror { kNone, kLeftRight, kUpDown };

  // Only these pictures are wrong, by their numbers, first and last; empty: all. Others stay as they are. For what
  // changes pictures or poses; names, rows and the camera belong to the whole set.
  std::vector<std::pair<uint64_t, uint64_t>> images;
  bool plain_text = false;     // images.csv as UTF-8 with commas, decimal points, '-' for minus (plain_csv.h)
  std::vector<uint64_t> drop;  // pictures that are left out, by their numbers
  int shift_rows = 0;  // the picture of row k belongs to row k + shift_rows; rows that get none are dropped
  int rotate_deg = 0;  // pictures are turned clockwise by 90, 180 or 270
  Mirror mirror = Mirror::kNone;
  bool swap_channels = false;  // red and blue
  std::vector<std::pair<std::string, std::string>>
      rename_objects;        // from, to; all at once, so that two can swap
  double scale_camera = 1;   // fx, fy, cx and cy: of pictures of another size
  double scale_focal = 1;    // fx and fy alone
  double scale_lengths = 1;  // eye and at
  // Each row has one entry of +1 or -1, each column too: new vector = axes * old one, of eye, at and up.
  std::optional<Eigen::Matrix3d> axes;
  bool swap_eye_at = false;
  std::optional<Eigen::Vector3d> up;                      // of every picture
  bool reverse_up = false;                                // it points the other way
  std::optional<std::pair<uint64_t, uint64_t>> exchange;  // these two pictures, by their numbers, change rows

  bool empty() const;
  bool changes_pixels() const { return rotate_deg != 0 || mirror != Mirror::kNone || swap_channels; }
};

// Fixes the set, measured poses like commanded ones. Returns the rows of the old set that are left. Errors: an object
// that the set does not have, a factor that is not above 0, a turn that is none of those, a shift beyond the set.
absl::StatusOr<std::vector<int>> ApplyFix(const ImageSetFix& fix, ImageSet* set);

// The options of `touchstone session fix` that do it: "--mirror left-right".
std::string FixOptions(const ImageSetFix& fix);

// The files of a fixed set: fields that stay are copied byte for byte, and so are pictures whose pixels stay.
struct FixedImageSet {
  std::string images_csv, camera_yaml;
  std::map<std::string, std::vector<uint8_t>> changed_pixels;  // by file, in the size and channels of `set`
  ImageSet set;                                                // as it is then
};
// `set`: as it was read from the texts of images.csv and camera.yaml.
absl::StatusOr<FixedImageSet> FixImageSet(const ImageSet& set, absl::string_view images_csv,
                                          absl::string_view camera_yaml, const ImageSetFix& fix);

}  // namespace touchstone::session
