#include "client/cli/session/image_set.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/source/dataset/synced_file.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/image/photograph/photograph.h"
#include "server/service/core/convert.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/emulated.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/images_csv.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

// When the picture was taken, Unix seconds: where an interrupted run resumes, its session time goes on.
constexpr char kUnixCovariate[] = "cov_unix_s";
// Pixel centres lie at half-integers in an image set, at integers where OpenCV's numbers are used.
constexpr double kHalf = 0.5;
constexpr double kMaxFocalDifferencePx = 1e-6;  // of numbers that were written shorter once

absl::Status WriteWhole(const std::string& path, const std::string& text) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto file, client::SyncedFile::Create(path));
  TOUCHSTONE_RETURN_IF_ERROR(file->Write(text));
  return file->Commit().status();
}

session::CameraIntrinsics IntrinsicsOf(const ImageSetCamera& camera) {
  const image::Intrinsics pinhole =
      image::PinholeIntrinsics(camera.width_px, camera.height_px, camera.vertical_fov_rad);
  session::CameraIntrinsics intrinsics;
  intrinsics.width_px = camera.width_px, intrinsics.height_px = camera.height_px;
  intrinsics.fx_px = pinhole.fx_px, intrinsics.fy_px = pinhole.fy_px;
  intrinsics.cx_px = pinhole.cx_px + kHalf, intrinsics.cy_px = pinhole.cy_px + kHalf;
  return intrinsics;
}

bool SameCamera(const session::CameraIntrinsics& a, const session::CameraIntrinsics& b) {
  const auto near = [](double x, double y) { return std::abs(x - y) <= kMaxFocalDifferencePx; };
  return a.width_px == b.width_px && a.height_px == b.height_px && near(a.fx_px, b.fx_px) &&
         near(a.fy_px, b.fy_px) && near(a.cx_px, b.cx_px) && near(a.cy_px, b.cy_px) && near(a.k1, b.k1) &&
         near(a.k2, b.k2) && near(a.p1, b.p1) && near(a.p2, b.p2) && near(a.k3, b.k3);
}

session::CameraPlacement PlacementOf(const v1::CameraPose& pose) {
  return {service::FromProto(pose.eye_m()), service::FromProto(pose.at_m()), service::FromProto(pose.up())};
}

// To the millisecond: the clock behind it knows no better, and the file is for people too.
double InMilliseconds(double seconds) {
  return std::round(seconds * 1e3) / 1e3;
}

absl::StatusOr<std::string> ReadIfThere(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return std::string();
  return ReadFile(path, session::kMaxImagesCsvBytes);
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
  const std::string images = set.PathOf(session::kImagesCsv), yaml = set.PathOf(session::kCameraYaml);
  const session::CameraIntrinsics intrinsics = IntrinsicsOf(camera);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string yaml_text, ReadIfThere(yaml));
  if (yaml_text.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(WriteWhole(yaml, session::FormatCameraYaml(intrinsics)));
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(const session::CameraIntrinsics there,
                                session::ParseCameraYaml(yaml_text, yaml));
    if (!SameCamera(there, intrinsics))
      return absl::FailedPreconditionError(absl::StrCat(
          yaml, " is of pictures of another size or field of view: it says ",
          absl::StripAsciiWhitespace(yaml_text), ", and these would be ",
          absl::StripAsciiWhitespace(session::FormatCameraYaml(intrinsics)), "; choose another folder"));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string csv, ReadIfThere(images));
  if (!csv.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(set.set_, session::ParseImagesCsv(csv, images));
  }
  set.set_.camera = intrinsics;
  set.set_.has_session_time = set.set_.has_round = true;
  for (const session::PhotographRow& row : set.set_.photographs) {
    const auto unix_s = row.covariates.find(kUnixCovariate);
    if (unix_s == row.covariates.end())
      return absl::InvalidArgumentError(
          absl::StrCat(images, ":", row.line, ": has no ", kUnixCovariate,
                       ", so it is not of this command's making: choose another folder"));
    if (set.first_unix_s_ == 0 || unix_s->second < set.first_unix_s_) set.first_unix_s_ = unix_s->second;
    set.next_number_ = std::max(set.next_number_, row.image + 1);
  }
  return set;
}

const session::PhotographRow* ImageSet::Find(const std::string& file) const {
  for (const session::PhotographRow& row : set_.photographs)
    if (row.file == file) return &row;
  return nullptr;
}

absl::StatusOr<bool> ImageSet::Has(const std::string& file) const {
  std::error_code error;
  const bool stands = fs::exists(PathOf(file), error), known = Find(file) != nullptr;
  if (stands && !known)
    return absl::FailedPreconditionError(absl::StrCat(PathOf(file), " stands there without a row in ",
                                                      PathOf(session::kImagesCsv),
                                                      ", so its pose is unknown: move it away, "
                                                      "or choose another folder"));
  return stands;
}

absl::Status ImageSet::Add(const ImageSetRow& added) {
  const double unix_s = InMilliseconds(added.photograph.unix_s());
  if (first_unix_s_ == 0) first_unix_s_ = unix_s;
  session::PhotographRow row;
  row.image = next_number_++;
  row.file = added.file;
  row.round = added.round;
  row.commanded = PlacementOf(added.commanded);
  if (added.photograph.has_measured()) row.measured = PlacementOf(added.photograph.measured());
  // A wall clock that was set back must not put a picture before the beginning.
  row.session_time_s = InMilliseconds(std::max(0.0, unix_s - first_unix_s_));
  row.covariates[kUnixCovariate] = unix_s;
  if (added.emulated) row.covariates[session::kEmulatedCovariate] = 1;
  const auto object = std::find(set_.objects.begin(), set_.objects.end(), added.object);
  row.object = static_cast<int>(object - set_.objects.begin());
  if (object == set_.objects.end()) set_.objects.push_back(added.object);
  std::vector<session::PhotographRow>& rows = set_.photographs;
  rows.erase(std::remove_if(rows.begin(), rows.end(),
                            [&](const session::PhotographRow& other) { return other.file == row.file; }),
             rows.end());
  rows.push_back(std::move(row));
  return WriteWhole(PathOf(session::kImagesCsv), session::FormatImagesCsv(set_));
}

}  // namespace touchstone::cli
