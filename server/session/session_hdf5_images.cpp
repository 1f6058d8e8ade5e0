#include "server/session/session_hdf5_images.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"

namespace touchstone::session {
namespace {

constexpr uint64_t kMaxLensRows = 1u << 28;
constexpr uint64_t kMaxCoefficients = 14;  // of a lens, as OpenCV has them

// How each picture was taken; NaN and no coefficients for one of which that was not kept.
void WriteViews(const std::vector<JournalImage>& images, Hdf5Columns* columns) {
  const hsize_t rows = images.size();
  std::vector<double> eye, at, up, object, session_time, lens, distortion;
  std::vector<uint64_t> has_view, coefficients;
  JournalView unknown;
  for (std::array<double, 3>* point : {&unknown.eye_m, &unknown.at_m, &unknown.up}) point->fill(kNaN);
  unknown.base_from_object.fill(kNaN);
  unknown.fx_px = unknown.fy_px = unknown.cx_px = unknown.cy_px = kNaN;
  for (const JournalImage& image : images) {
    const JournalView& view = image.view ? *image.view : unknown;
    has_view.push_back(image.view.has_value());
    eye.insert(eye.end(), view.eye_m.begin(), view.eye_m.end());
    at.insert(at.end(), view.at_m.begin(), view.at_m.end());
    up.insert(up.end(), view.up.begin(), view.up.end());
    object.insert(object.end(), view.base_from_object.begin(), view.base_from_object.end());
    session_time.push_back(view.session_time_s);
    lens.insert(lens.end(), {view.fx_px, view.fy_px, view.cx_px, view.cy_px});
    coefficients.push_back(view.distortion.size());
    distortion.insert(distortion.end(), view.distortion.begin(), view.distortion.end());
  }
  columns->Whole("images/has_view", has_view, {rows});
  columns->Numbers("images/eye_m", "m", eye, {rows, 3});
  columns->Numbers("images/at_m", "m", at, {rows, 3});
  columns->Numbers("images/up", "", up, {rows, 3});
  columns->Numbers("images/base_from_object_m_rad", "m, rad", object, {rows, 6});
  columns->Numbers("images/session_time_s", "s", session_time, {rows});
  columns->Numbers("images/fx_fy_cx_cy_px", "px", lens, {rows, 4});
  columns->Whole("images/distortion_coefficients", coefficients, {rows});
  columns->Numbers("images/distortion", "", distortion, {distortion.size()});
}

absl::Status ReadViews(const Hdf5ColumnsReader& file, std::vector<JournalImage>* images) {
  // Files of before these were kept have none.
  if (!file.Has("images/has_view")) return absl::OkStatus();
  const uint64_t rows = images->size();
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto has_view, file.Whole("images/has_view", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto eye, file.Numbers("images/eye_m", 3 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto at, file.Numbers("images/at_m", 3 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto up, file.Numbers("images/up", 3 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto object, file.Numbers("images/base_from_object_m_rad", 6 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto session_time, file.Numbers("images/session_time_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lens, file.Numbers("images/fx_fy_cx_cy_px", 4 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto coefficients, file.Whole("images/distortion_coefficients", rows));
  uint64_t all = 0;
  for (const uint64_t count : coefficients)
    if (count > kMaxCoefficients || (all += count) > kMaxLensRows)
      return absl::InvalidArgumentError(absl::StrCat("images/distortion_coefficients: ", count,
                                                     " of one lens; at most ", kMaxCoefficients,
                                                     " were expected"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto distortion, file.Numbers("images/distortion", all));
  uint64_t next = 0;
  for (uint64_t k = 0; k < rows; ++k) {
    const uint64_t begin = next;
    next += coefficients[k];
    if (has_view[k] == 0) continue;
    JournalView& view = (*images)[k].view.emplace();
    std::copy_n(eye.begin() + 3 * k, 3, view.eye_m.begin());
    std::copy_n(at.begin() + 3 * k, 3, view.at_m.begin());
    std::copy_n(up.begin() + 3 * k, 3, view.up.begin());
    std::copy_n(object.begin() + 6 * k, 6, view.base_from_object.begin());
    view.session_time_s = session_time[k];
    view.fx_px = lens[4 * k], view.fy_px = lens[4 * k + 1];
    view.cx_px = lens[4 * k + 2], view.cy_px = lens[4 * k + 3];
    view.distortion.assign(distortion.begin() + begin, distortion.begin() + next);
  }
  return absl::OkStatus();
}

}  // namespace

void WriteHdf5Images(const std::vector<JournalImage>& images, Hdf5Columns* columns) {
  const hsize_t rows = images.size();
  std::vector<std::string> ids, objects, up_faces, pngs;
  std::vector<uint64_t> sizes;
  std::vector<double> poses, measured, measured_unix_s, unix_s;
  for (const JournalImage& image : images) {
    ids.push_back(image.id);
    objects.push_back(image.object);
    up_faces.push_back(image.up_face);
    pngs.push_back(image.png);
    sizes.insert(sizes.end(), {static_cast<uint64_t>(image.width), static_cast<uint64_t>(image.height)});
    poses.insert(poses.end(), image.base_from_camera.begin(), image.base_from_camera.end());
    measured.insert(measured.end(), image.measured_base_from_camera.begin(),
                    image.measured_base_from_camera.end());
    measured_unix_s.push_back(image.measured_unix_s);
    unix_s.push_back(image.unix_s);
  }
  columns->Texts("images/id", ids);
  columns->Texts("images/object", objects);
  columns->Texts("images/placement", up_faces);
  columns->Whole("images/width_height_px", sizes, {rows, 2});
  columns->Numbers("images/base_from_camera_m_rad", "m, rad", poses, {rows, 6});
  columns->Numbers("images/measured_base_from_camera_m_rad", "m, rad", measured, {rows, 6});
  columns->Numbers("images/measured_unix_s", "s", measured_unix_s, {rows});
  columns->Numbers("images/unix_s", "s", unix_s, {rows});
  columns->Bytes("images/png", pngs);
  WriteViews(images, columns);
}

absl::Status ReadHdf5Images(const Hdf5ColumnsReader& file, uint64_t rows, std::vector<JournalImage>* images) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto ids, file.Texts("images/id", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto objects, file.Texts("images/object", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto up_faces, file.Texts("images/placement", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto sizes, file.Whole("images/width_height_px", 2 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto poses, file.Numbers("images/base_from_camera_m_rad", 6 * rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto unix_s, file.Numbers("images/unix_s", rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto pngs, file.Bytes("images/png", rows));
  // Files of before these were kept have none.
  std::vector<double> measured(6 * rows, kNaN), measured_unix_s(rows, kNaN);
  if (file.Has("images/measured_base_from_camera_m_rad")) {
    TOUCHSTONE_ASSIGN_OR_RETURN(measured, file.Numbers("images/measured_base_from_camera_m_rad", 6 * rows));
    TOUCHSTONE_ASSIGN_OR_RETURN(measured_unix_s, file.Numbers("images/measured_unix_s", rows));
  }
  images->resize(rows);
  for (uint64_t k = 0; k < rows; ++k) {
    JournalImage& image = (*images)[k];
    image.id = ids[k];
    image.object = objects[k];
    image.up_face = up_faces[k];
    image.width = static_cast<int>(sizes[2 * k]);
    image.height = static_cast<int>(sizes[2 * k + 1]);
    for (int i = 0; i < 6; ++i) {
      image.base_from_camera[i] = poses[6 * k + i];
      image.measured_base_from_camera[i] = measured[6 * k + i];
    }
    image.measured_unix_s = measured_unix_s[k];
    image.unix_s = unix_s[k];
    image.png = pngs[k];
  }
  return ReadViews(file, images);
}

}  // namespace touchstone::session
