// The folder of `touchstone rig photos` as an image set: images.csv with one row per picture, its commanded and its
// measured pose, and camera.yaml with the intrinsics of all of them.
#pragma once

#include <map>
#include <string>

#include <absl/status/statusor.h>

#include "touchstone/v1/source.pb.h"

namespace touchstone::cli {

// A picture that was taken.
struct ImageSetRow {
  std::string file;  // without its folder
  std::string object;
  v1::CameraPose commanded;
  v1::Photograph photograph;
};

// Ideal pinhole of all pictures.
struct ImageSetCamera {
  int width_px = 0, height_px = 0;
  double vertical_fov_rad = 0;
};

class ImageSet {
 public:
  // Makes the folder where there is none. What an earlier run left is kept: INVALID_ARGUMENT with the file and the line
  // if it cannot be read, FAILED_PRECONDITION if its pictures are of another camera.
  static absl::StatusOr<ImageSet> Open(const std::string& folder, const ImageSetCamera& camera);

  // Whether the picture and its row are there. FAILED_PRECONDITION: a picture without a row, whose pose is unknown.
  absl::StatusOr<bool> Has(const std::string& file) const;
  // Before the picture itself is written; images.csv is whole on the disk when this returns.
  absl::Status Add(const ImageSetRow& row);
  size_t size() const { return lines_.size(); }
  std::string PathOf(const std::string& file) const;

 private:
  std::string folder_;
  std::map<std::string, std::string> lines_;  // of images.csv after its number, by file
  double first_unix_s_ = 0;                   // of the oldest row; 0: there is none
};

}  // namespace touchstone::cli
