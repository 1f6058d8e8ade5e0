// The folder of `touchstone rig photos` as an image set (server/session/measurement_files.md) that grows picture by
// picture: images.csv and camera.yaml are written as every other image set is.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/session/images/image_set.h"
#include "touchstone/v1/source.pb.h"

namespace touchstone::cli {

// A picture that was taken.
struct ImageSetRow {
  std::string file;  // without its folder
  std::string object;
  int round = 0;
  v1::CameraPose commanded;
  v1::Photograph photograph;
  bool emulated = false;
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
  // Before the picture itself is written; images.csv is whole on the disk when this returns. A row of the same file is
  // replaced: its picture was never written.
  absl::Status Add(const ImageSetRow& row);
  size_t size() const { return set_.size(); }
  std::string PathOf(const std::string& file) const;

 private:
  const session::PhotographRow* Find(const std::string& file) const;

  std::string folder_;
  session::ImageSet set_;     // without pixels
  double first_unix_s_ = 0;   // of the oldest row; 0: there is none
  uint64_t next_number_ = 1;  // of the next row
};

}  // namespace touchstone::cli
