#include "client/cli/image_set.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "client/source/synced_file.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/base/units.h"
#include "server/image/photograph.h"
#include "server/session/csv_fields.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

// The measured pose is empty where the source does not know it. cov_unix_s: when the picture was taken, Unix seconds.
constexpr char kImagesHeader[] =
    "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z,session_time_s,"
    "measured_eye_x_mm,measured_eye_y_mm,measured_eye_z_mm,measured_at_x_mm,measured_at_y_mm,measured_at_z_"
    "mm,"
    "measured_up_x,measured_up_y,measured_up_z,cov_unix_s";
// Pixel centres lie at half-integers in an image set, at integers where OpenCV's numbers are used.
constexpr double kHalf = 0.5;
constexpr size_t kUnixColumn = 22;

std::string TextOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

absl::Status WriteWhole(const std::string& path, const std::string& text) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto file, client::SyncedFile::Create(path));
  TOUCHSTONE_RETURN_IF_ERROR(file->Write(text));
  return file->Commit().status();
}

std::string CameraText(const ImageSetCamera& camera) {
  const image::Intrinsics pinhole =
      image::PinholeIntrinsics(camera.width_px, camera.height_px, camera.vertical_fov_rad);
  return absl::StrFormat(
      "{width_px: %d, height_px: %d, fx_px: %.10g, fy_px: %.10g, cx_px: %.10g, cy_px: %.10g}\n",
      camera.width_px, camera.height_px, pinhole.fx_px, pinhole.fy_px, pinhole.cx_px + kHalf,
      pinhole.cy_px + kHalf);
}

void AppendPose(const v1::CameraPose& pose, std::string* line) {
  for (const v1::Vector3* point : {&pose.eye_m(), &pose.at_m()})
    for (const double metres : {point->x(), point->y(), point->z()})
      absl::StrAppend(line, ",", absl::StrFormat("%.6f", metres / kMetresPerMillimetre));
  for (const double part : {pose.up().x(), pose.up().y(), pose.up().z()})
    absl::StrAppend(line, ",", absl::StrFormat("%.9f", part));
}

}  // namespace

std::string ImageSet::PathOf(const std::string& file) const {
  return (fs::path(folder_) / file).string();
}

absl::StatusOr<ImageSet> ImageSet::Open(const std::string& folder, const ImageSetCamera& camera) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    return absl::InvalidArgumentError(absl::StrCat("-o: ", folder, " cannot be made: ", error.message()));
  ImageSet set;
  set.folder_ = folder;
  const std::string images = set.PathOf("images.csv"), intrinsics = set.PathOf("camera.yaml");
  if (fs::exists(intrinsics, error)) {
    if (TextOf(intrinsics) != CameraText(camera))
      return absl::FailedPreconditionError(
          absl::StrCat(intrinsics, " is of pictures of another size or field of view: it says ",
                       absl::StripAsciiWhitespace(TextOf(intrinsics)), ", and these would be ",
                       absl::StripAsciiWhitespace(CameraText(camera)), "; choose another folder"));
  } else {
    TOUCHSTONE_RETURN_IF_ERROR(WriteWhole(intrinsics, CameraText(camera)));
  }
  if (!fs::exists(images, error)) return set;
  const std::string text = TextOf(images);
  const std::vector<std::string> lines = absl::StrSplit(text, '\n', absl::SkipWhitespace());
  if (lines.empty() || absl::StripAsciiWhitespace(lines[0]) != kImagesHeader)
    return absl::InvalidArgumentError(absl::StrCat(images, ":1: the header is not that of this command (",
                                                   kImagesHeader, "): choose another folder"));
  for (size_t k = 1; k < lines.size(); ++k) {
    session::CsvFields fields;
    TOUCHSTONE_RETURN_IF_ERROR(fields.Cut(absl::StripTrailingAsciiWhitespace(lines[k])));
    double unix_s = 0;
    if (fields.all().size() != kUnixColumn + 1 || !absl::SimpleAtod(fields.all()[kUnixColumn], &unix_s))
      return absl::InvalidArgumentError(absl::StrCat(images, ":", k + 1, ": has ", fields.all().size(),
                                                     " fields, the last '", fields.all().back(), "'; ",
                                                     kUnixColumn + 1, " were expected, the last a time"));
    if (set.first_unix_s_ == 0 || unix_s < set.first_unix_s_) set.first_unix_s_ = unix_s;
    const std::string line(absl::StripTrailingAsciiWhitespace(lines[k]));
    set.lines_[std::string(fields.all()[1])] = line.substr(line.find(',') + 1);
  }
  return set;
}

absl::StatusOr<bool> ImageSet::Has(const std::string& file) const {
  std::error_code error;
  const bool stands = fs::exists(PathOf(file), error), known = lines_.count(file) > 0;
  if (stands && !known)
    return absl::FailedPreconditionError(absl::StrCat(PathOf(file), " stands there without a row in ",
                                                      PathOf("images.csv"),
                                                      ", so its pose is unknown: move it away, "
                                                      "or choose another folder"));
  return stands;
}

absl::Status ImageSet::Add(const ImageSetRow& row) {
  const v1::Photograph& photograph = row.photograph;
  if (first_unix_s_ == 0) first_unix_s_ = photograph.unix_s();
  std::string line = absl::StrCat(row.file, ",", row.object);
  AppendPose(row.commanded, &line);
  absl::StrAppend(&line, ",", absl::StrFormat("%.3f", photograph.unix_s() - first_unix_s_));
  if (photograph.has_measured())
    AppendPose(photograph.measured(), &line);
  else
    absl::StrAppend(&line, std::string(9, ','));
  absl::StrAppend(&line, ",", absl::StrFormat("%.3f", photograph.unix_s()));
  lines_[row.file] = line;
  std::string text = absl::StrCat(kImagesHeader, "\n");
  int number = 0;
  for (const auto& [file, rest] : lines_) absl::StrAppend(&text, ++number, ",", rest, "\n");
  return WriteWhole(PathOf("images.csv"), text);
}

}  // namespace touchstone::cli
