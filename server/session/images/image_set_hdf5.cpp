#include "server/session/images/image_set_hdf5.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/image/image.h"
#include "server/session/hdf5/hdf5_file.h"
#include "server/session/images/image_set.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/images_csv.h"

namespace touchstone::session {
namespace {

constexpr char kImageSetFormat[] = "touchstone: image_set/1";
constexpr uint64_t kMaxCovariates = 4096;
constexpr uint64_t kUnknownNumber = std::numeric_limits<uint64_t>::max();  // of a round or touch

struct LensDataset {
  const char* name;
  double CameraIntrinsics::*number;
};
constexpr LensDataset kLens[] = {
    {"camera/fx_px", &CameraIntrinsics::fx_px}, {"camera/fy_px", &CameraIntrinsics::fy_px},
    {"camera/cx_px", &CameraIntrinsics::cx_px}, {"camera/cy_px", &CameraIntrinsics::cy_px},
    {"camera/k1", &CameraIntrinsics::k1},       {"camera/k2", &CameraIntrinsics::k2},
    {"camera/p1", &CameraIntrinsics::p1},       {"camera/p2", &CameraIntrinsics::p2},
    {"camera/k3", &CameraIntrinsics::k3}};

void AppendXyz(const Eigen::Vector3d& v, std::vector<double>* values) {
  values->insert(values->end(), {v.x(), v.y(), v.z()});
}

// Three datasets of a placement: "eye_m", "at_m", "up".
struct Placements {
  std::vector<double> eye, at, up;
  void Append(const CameraPlacement& placement) {
    AppendXyz(placement.eye_m, &eye), AppendXyz(placement.at_m, &at), AppendXyz(placement.up, &up);
  }
  void Write(const std::string& prefix, hsize_t rows, Hdf5Columns* columns) const {
    columns->Numbers(prefix + "eye_m", "m", eye, {rows, 3});
    columns->Numbers(prefix + "at_m", "m", at, {rows, 3});
    columns->Numbers(prefix + "up", "", up, {rows, 3});
  }
  absl::Status Read(const Hdf5ColumnsReader& file, const std::string& prefix, uint64_t rows) {
    TOUCHSTONE_ASSIGN_OR_RETURN(eye, file.Numbers(prefix + "eye_m", 3 * rows));
    TOUCHSTONE_ASSIGN_OR_RETURN(at, file.Numbers(prefix + "at_m", 3 * rows));
    TOUCHSTONE_ASSIGN_OR_RETURN(up, file.Numbers(prefix + "up", 3 * rows));
    return absl::OkStatus();
  }
  CameraPlacement At(uint64_t k) const {
    return {{eye[3 * k], eye[3 * k + 1], eye[3 * k + 2]},
            {at[3 * k], at[3 * k + 1], at[3 * k + 2]},
            {up[3 * k], up[3 * k + 1], up[3 * k + 2]}};
  }
};

// Grey pictures beside RGB ones stand there three times; `channels` says which they are.
void WritePixels(const ImageSet& set, Hdf5Columns* columns) {
  uint64_t most = 1;
  std::vector<uint64_t> channels;
  for (const PhotographRow& row : set.photographs) {
    channels.push_back(row.channels);
    most = std::max(most, channels.back());
  }
  std::vector<uint8_t> pixels;
  pixels.reserve(set.size() * set.camera.width_px * set.camera.height_px * most);
  for (const PhotographRow& row : set.photographs)
    for (size_t i = 0; i < row.pixels.size(); ++i)
      pixels.insert(pixels.end(), most / row.channels, row.pixels[i]);
  std::vector<hsize_t> shape = {set.size(), static_cast<hsize_t>(set.camera.height_px),
                                static_cast<hsize_t>(set.camera.width_px)};
  if (most > 1) shape.push_back(most);
  columns->Whole("set/size", {set.size(), shape[1], shape[2], most}, {4});
  columns->Pixels("image", pixels, shape);
  columns->Whole("channels", channels, {set.size()});
}

void WritePhotographs(const ImageSet& set, Hdf5Columns* columns) {
  const hsize_t rows = set.size();
  Placements commanded, measured;
  std::vector<std::string> files, objects;
  std::vector<uint64_t> image, round, touch;
  std::vector<double> session_time;
  const CameraPlacement unknown{Eigen::Vector3d::Constant(kNaN), Eigen::Vector3d::Constant(kNaN),
                                Eigen::Vector3d::Constant(kNaN)};
  for (const PhotographRow& row : set.photographs) {
    image.push_back(row.image);
    files.push_back(row.file);
    objects.push_back(set.objects[row.object]);
    commanded.Append(row.commanded);
    measured.Append(row.measured.value_or(unknown));
    session_time.push_back(row.session_time_s);
    round.push_back(row.round < 0 ? kUnknownNumber : static_cast<uint64_t>(row.round));
    touch.push_back(row.touch.value_or(kUnknownNumber));
  }
  columns->Whole("image_number", image, {rows});
  columns->Texts("file", files);
  columns->Texts("object", objects);
  commanded.Write("", rows, columns);
  if (set.has_measured) measured.Write("measured_", rows, columns);
  if (set.has_session_time) columns->Numbers("session_time_s", "s", session_time, {rows});
  if (set.has_round) columns->Whole("round", round, {rows});
  columns->Whole("touch", touch, {rows});
  const std::vector<std::string> names = ColumnsOf(set).covariates;
  columns->Whole("set/covariates", {names.size()}, {1});
  columns->Texts("covariate_names", names);
  for (const std::string& name : names) {
    std::vector<double> values;
    for (const PhotographRow& row : set.photographs) {
      const auto found = row.covariates.find(name);
      values.push_back(found == row.covariates.end() ? kNaN : found->second);
    }
    columns->Numbers("covariates/" + name, "", values, {rows});
  }
}

absl::Status ReadPixels(const Hdf5ColumnsReader& file, const std::string& path, ImageSet* set) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto size, file.Whole("set/size", 4));
  const auto [rows, height, width, most] = std::tie(size[0], size[1], size[2], size[3]);
  if (rows < 1 || rows > kMaxPhotographs || height < 1 || height > image::kMaxImageSide || width < 1 ||
      width > image::kMaxImageSide || (most != 1 && most != 3) ||
      rows * height * width * most > kMaxImageSetBytes)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": dataset set/size says ", rows, " pictures of ", height, " x ", width, " x ",
                     most, "; at most ", kMaxPhotographs, " of 1 or 3 channels and ", image::kMaxImageSide,
                     " a side, in all ", kMaxImageSetBytes >> 20, " MiB, were expected"));
  set->camera.width_px = static_cast<int>(width), set->camera.height_px = static_cast<int>(height);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto pixels, file.Pixels("image", rows * height * width * most));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto channels, file.Whole("channels", rows));
  set->photographs.resize(rows);
  const uint64_t each = height * width * most;
  for (uint64_t k = 0; k < rows; ++k) {
    if (channels[k] != 1 && channels[k] != most)
      return absl::InvalidArgumentError(absl::StrCat(path, ": dataset channels: picture ", k, " has ",
                                                     channels[k], "; 1 or ", most, " was expected"));
    PhotographRow& row = set->photographs[k];
    row.channels = static_cast<int>(channels[k]);
    for (uint64_t i = 0; i < each; i += most / channels[k]) row.pixels.push_back(pixels[k * each + i]);
  }
  return absl::OkStatus();
}

absl::Status ReadNumbers(const Hdf5ColumnsReader& file, const std::string& path, ImageSet* set) {
  const uint64_t rows = set->size();
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto image, file.Whole("image_number", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto files, file.Texts("file", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto objects, file.Texts("object", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto touch, file.Whole("touch", rows));
  Placements commanded, measured;
  TOUCHSTONE_RETURN_IF_ERROR(commanded.Read(file, "", rows));
  set->has_measured = file.Has("measured_eye_m");
  if (set->has_measured) TOUCHSTONE_RETURN_IF_ERROR(measured.Read(file, "measured_", rows));
  set->has_session_time = file.Has("session_time_s"), set->has_round = file.Has("round");
  std::vector<double> session_time(rows, 0);
  std::vector<uint64_t> round(rows, kUnknownNumber);
  if (set->has_session_time) {
    TOUCHSTONE_ASSIGN_OR_RETURN(session_time, file.Numbers("session_time_s", rows));
  }
  if (set->has_round) {
    TOUCHSTONE_ASSIGN_OR_RETURN(round, file.Whole("round", rows));
  }
  for (uint64_t k = 0; k < rows; ++k) {
    PhotographRow& row = set->photographs[k];
    row.image = image[k];
    row.file = files[k];
    const auto object = std::find(set->objects.begin(), set->objects.end(), objects[k]);
    row.object = static_cast<int>(object - set->objects.begin());
    if (object == set->objects.end()) set->objects.push_back(objects[k]);
    row.commanded = commanded.At(k);
    if (set->has_measured && !measured.At(k).eye_m.hasNaN()) row.measured = measured.At(k);
    row.session_time_s = session_time[k];
    if (round[k] != kUnknownNumber && round[k] > std::numeric_limits<int>::max())
      return absl::InvalidArgumentError(absl::StrCat(path, ": dataset round: ", round[k],
                                                     " is out of range; at most ",
                                                     std::numeric_limits<int>::max(), " was expected"));
    row.round = round[k] == kUnknownNumber ? -1 : static_cast<int>(round[k]);
    if (touch[k] != kUnknownNumber) row.touch = touch[k];
  }
  return absl::OkStatus();
}

absl::Status ReadCovariates(const Hdf5ColumnsReader& file, const std::string& path, ImageSet* set) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto count, file.Whole("set/covariates", 1));
  if (count[0] > kMaxCovariates)
    return absl::InvalidArgumentError(absl::StrCat(path, ": dataset set/covariates says ", count[0],
                                                   "; at most ", kMaxCovariates, " are read"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto names, file.Texts("covariate_names", count[0]));
  for (const std::string& name : names) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto values, file.Numbers("covariates/" + name, set->size()));
    for (size_t k = 0; k < values.size(); ++k)
      if (!std::isnan(values[k])) set->photographs[k].covariates[name] = values[k];
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteImageSetHdf5(const ImageSetWithTouches& files, const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const ImageSet set, ParseImageSet(files.images));
  Hdf5Columns columns(path);
  columns.Texts("set/format", {kImageSetFormat});
  WritePixels(set, &columns);
  WritePhotographs(set, &columns);
  for (const LensDataset& lens : kLens) columns.Numbers(lens.name, "", {set.camera.*lens.number}, {1});
  if (!files.touches_csv.empty()) columns.Bytes("touches_csv", {files.touches_csv});
  return columns.Finish();
}

bool IsImageSetHdf5(const std::string& path) {
  const auto file = Hdf5ColumnsReader::Open(path);
  if (!file.ok() || !file->Has("set/format")) return false;
  const auto format = file->Texts("set/format", 1);
  return format.ok() && (*format)[0] == kImageSetFormat;
}

absl::StatusOr<ImageSetWithTouches> ReadImageSetHdf5(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5ColumnsReader file, Hdf5ColumnsReader::Open(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto format, file.Texts("set/format", 1));
  if (format[0] != kImageSetFormat)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": is of format '", format[0], "'; this program reads '", kImageSetFormat, "'"));
  ImageSet set;
  set.origin = path;
  TOUCHSTONE_RETURN_IF_ERROR(ReadPixels(file, path, &set));
  TOUCHSTONE_RETURN_IF_ERROR(ReadNumbers(file, path, &set));
  TOUCHSTONE_RETURN_IF_ERROR(ReadCovariates(file, path, &set));
  for (const LensDataset& lens : kLens) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto number, file.Numbers(lens.name, 1));
    set.camera.*lens.number = number[0];
  }
  ImageSetWithTouches read;
  TOUCHSTONE_ASSIGN_OR_RETURN(read.images, FormatImageSet(set));
  // What a folder may not hold, a file may not bring in either.
  TOUCHSTONE_RETURN_IF_ERROR(ParseImageSet(read.images).status());
  if (file.Has("touches_csv")) {
    TOUCHSTONE_ASSIGN_OR_RETURN(auto touches, file.Bytes("touches_csv", 1));
    read.touches_csv = std::move(touches[0]);
  }
  return read;
}

}  // namespace touchstone::session
