#include "server/session/session_images.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/pose.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/emulated.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/images_csv.h"

namespace touchstone::session {
namespace {

constexpr char kTakenAtCovariate[] = "cov_unix_s";
constexpr double kHalfPixel = 0.5;  // OpenCV's pixel centres lie at integers, an image set's at half-integers
constexpr size_t kImageSetCoefficients = 5;  // k1 k2 p1 p2 k3

Eigen::Vector3d VectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

// As far from the eye as was commanded.
std::optional<CameraPlacement> MeasuredPlacement(const JournalImage& image) {
  const Eigen::Isometry3d base_from_camera = geometry::PoseFromVector(image.measured_base_from_camera);
  if (!base_from_camera.matrix().allFinite()) return std::nullopt;
  const Eigen::Isometry3d object_from_camera =
      geometry::PoseFromVector(image.view->base_from_object).inverse() * base_from_camera;
  CameraPlacement placement;
  placement.eye_m = object_from_camera.translation();
  const double distance_m = (VectorOf(image.view->at_m) - VectorOf(image.view->eye_m)).norm();
  placement.at_m = placement.eye_m + distance_m * object_from_camera.linear().col(2);
  placement.up = -object_from_camera.linear().col(1);
  return placement;
}

CameraIntrinsics LensOf(const JournalImage& image) {
  const JournalView& view = *image.view;
  CameraIntrinsics lens;
  lens.width_px = image.width, lens.height_px = image.height;
  lens.fx_px = view.fx_px, lens.fy_px = view.fy_px;
  lens.cx_px = view.cx_px + kHalfPixel, lens.cy_px = view.cy_px + kHalfPixel;
  double* const coefficients[kImageSetCoefficients] = {&lens.k1, &lens.k2, &lens.p1, &lens.p2, &lens.k3};
  for (size_t k = 0; k < std::min(kImageSetCoefficients, view.distortion.size()); ++k)
    *coefficients[k] = view.distortion[k];
  return lens;
}

class SessionImageSet {
 public:
  explicit SessionImageSet(const JournalSession& session)
      : emulated_(session.emulated), session_(session.name) {
    set_.origin = session.name;
    set_.has_session_time = set_.has_round = true;
  }

  absl::Status Add(const JournalImage& image) {
    if (!image.view)
      return Wrong(image,
                   "was journalled before a picture's view and lens were kept (version 3 of the journal), so "
                   "where its object lay is unknown; export the session as .h5, or take the picture again");
    const std::vector<double>& distortion = image.view->distortion;
    for (size_t k = kImageSetCoefficients; k < distortion.size(); ++k)
      if (distortion[k] != 0)
        return Wrong(image, absl::StrCat("was taken through a lens of ", distortion.size(),
                                         " coefficients, and an image set has k1, k2, p1, p2 and k3; take it "
                                         "with 'touchstone rig photos', which takes the distortion out"));
    const CameraIntrinsics lens = LensOf(image);
    const std::string yaml = FormatCameraYaml(lens);
    if (set_.photographs.empty()) {
      set_.camera = lens, camera_yaml_ = yaml;
    } else if (yaml != camera_yaml_) {
      return Wrong(
          image,
          absl::StrCat("has another lens or size than those before it, and an image set has one: ",
                       absl::StripAsciiWhitespace(yaml), " and ", absl::StripAsciiWhitespace(camera_yaml_),
                       "; export the session as .h5, which keeps both"));
    }
    bytes_ += image.png.size();
    if (bytes_ > kMaxImageSetBytes)
      return Wrong(image, absl::StrCat("makes more than the ", kMaxImageSetBytes >> 20,
                                       " MiB that an image set may have; export the session as .h5"));
    AppendRow(image);
    v1::ImageFile* file = files_.add_files();
    file->set_name(set_.photographs.back().file);
    file->set_png(image.png);
    return absl::OkStatus();
  }

  absl::StatusOr<v1::ImageSetFiles> Take() {
    if (set_.photographs.empty())
      return absl::FailedPreconditionError(absl::StrCat("session '", session_, "' has no photograph"));
    files_.set_origin(session_);
    files_.set_images_csv(FormatImagesCsv(set_));
    files_.set_camera_yaml(camera_yaml_);
    return std::move(files_);
  }

 private:
  void AppendRow(const JournalImage& image) {
    const JournalView& view = *image.view;
    PhotographRow row;
    row.image = image.number;
    row.file = absl::StrFormat("picture_%06u.png", image.number);
    const auto object = std::find(set_.objects.begin(), set_.objects.end(), image.object);
    row.object = static_cast<int>(object - set_.objects.begin());
    if (object == set_.objects.end()) set_.objects.push_back(image.object);
    row.commanded = {VectorOf(view.eye_m), VectorOf(view.at_m), VectorOf(view.up)};
    row.measured = MeasuredPlacement(image);
    if (std::isfinite(view.session_time_s))
      row.session_time_s = view.session_time_s;
    else
      set_.has_session_time = false;
    row.round = repeats_[{row.object, view.eye_m, view.at_m, view.up}]++;
    if (std::isfinite(image.unix_s)) row.covariates[kTakenAtCovariate] = image.unix_s;
    if (emulated_) row.covariates[kEmulatedCovariate] = 1;
    set_.photographs.push_back(std::move(row));
  }

  absl::Status Wrong(const JournalImage& image, absl::string_view what) const {
    return absl::FailedPreconditionError(
        absl::StrCat("picture ", image.number, " ('", image.id, "') of session '", session_, "' ", what));
  }

  using View = std::tuple<int, std::array<double, 3>, std::array<double, 3>, std::array<double, 3>>;

  const bool emulated_;
  const std::string session_;
  ImageSet set_;  // without pixels
  std::string camera_yaml_;
  v1::ImageSetFiles files_;
  std::map<View, int> repeats_;
  uint64_t bytes_ = 0;
};

}  // namespace

absl::StatusOr<v1::ImageSetFiles> SessionImageSetFiles(const Journal& journal, const std::string& name) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const JournalSession session, journal.Session(name));
  SessionImageSet set(session);
  absl::Status status;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachImage(name, [&](const JournalImage& image) {
    status = set.Add(image);
    return status.ok();
  }));
  TOUCHSTONE_RETURN_IF_ERROR(status);
  return set.Take();
}

}  // namespace touchstone::session
