#include "server/session/session_content_checks.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/image/encoding/encode.h"
#include "server/session/measurements/measurement_checks.h"
#include "server/session/recorded/touch_series.h"
#include "server/session/session_measurements.h"

namespace touchstone::session {
namespace {

constexpr double kMaxUnixS = 1e11;  // the year 5138
constexpr double kMaxUncertaintyS = 1e4;
constexpr double kMaxDrift = 1;          // of a clock, as a ratio
constexpr double kMaxPositionM = 100;    // of anything in a rig's frame
constexpr double kMaxRotationRad = 100;  // of a rotation vector: arms give some beyond a turn
constexpr double kMaxForceN = 1e6;
constexpr double kMaxFocalPx = 1e9;
constexpr int kMaxPictureSidePx = 1 << 16;
constexpr size_t kMaxIdBytes = 200;

// One touch or picture, as messages call it.
class Entry {
 public:
  Entry(const std::string& origin, const char* kind, size_t number)
      : origin_(origin), kind_(kind), number_(number) {}

  absl::Status Wrong(absl::string_view what) const {
    return absl::InvalidArgumentError(absl::StrCat(origin_, ": ", kind_, " ", number_, ": ", what));
  }
  // NaN says that a number is unknown.
  absl::Status Number(const char* name, double value, double min, double max) const {
    if (std::isnan(value) || (value >= min && value <= max)) return absl::OkStatus();
    return Wrong(absl::StrCat(name, " (", ShortestNumber(value), ") is out of range; ", ShortestNumber(min),
                              " to ", ShortestNumber(max), " was expected"));
  }
  template <typename Values>
  absl::Status Numbers(const char* name, const Values& values, double max) const {
    for (const double value : values) TOUCHSTONE_RETURN_IF_ERROR(Number(name, value, -max, max));
    return absl::OkStatus();
  }
  // Position and rotation vector.
  absl::Status Pose(const char* name, const std::array<double, 6>& pose) const {
    for (int i = 0; i < 6; ++i)
      TOUCHSTONE_RETURN_IF_ERROR(Number(name, pose[i], i < 3 ? -kMaxPositionM : -kMaxRotationRad,
                                        i < 3 ? kMaxPositionM : kMaxRotationRad));
    return absl::OkStatus();
  }
  absl::Status Text(const char* name, const std::string& text, size_t max_bytes) const {
    if (text.size() <= max_bytes && IsPrintableLine(text)) return absl::OkStatus();
    return Wrong(absl::StrCat(name, " ('", Printable(text, 40), "') has ", text.size(), " bytes; at most ",
                              max_bytes, " of UTF-8 without control characters were expected"));
  }
  absl::Status Face(const std::string& face) const {
    if (face.empty() ||
        (face.size() == 2 && (face[0] == '+' || face[0] == '-') && face[1] >= 'x' && face[1] <= 'z'))
      return absl::OkStatus();
    return Wrong(absl::StrCat("placement ('", Printable(face, 40),
                              "') is none; +x, -x, +y, -y, +z or -z was expected"));
  }

 private:
  const std::string& origin_;
  const char* const kind_;
  const size_t number_;
};

absl::Status CheckTouch(const JournalTouch& touch, const Entry& entry) {
  TOUCHSTONE_RETURN_IF_ERROR(entry.Text("id", touch.id, kMaxIdBytes));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Face(touch.up_face));
  const JournalResult& result = touch.result;
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("measured_speed_m_s", result.speed_m_s, 0, kMaxSpeedMS));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("session_time_s", result.session_time_s, 0, kMaxSessionTimeS));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("start_unix_s", result.start_unix_s, 0, kMaxUnixS));
  TOUCHSTONE_RETURN_IF_ERROR(
      entry.Number("time_uncertainty_s", result.time_uncertainty_s, 0, kMaxUncertaintyS));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("synchronisation_uncertainty_s",
                                          result.synchronisation_uncertainty_s, 0, kMaxUncertaintyS));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("effector_drift", result.effector_drift, -kMaxDrift, kMaxDrift));
  if (touch.attempt < 1) return entry.Wrong(absl::StrCat("attempt (", touch.attempt, ") is below 1"));
  for (const JournalFinger& finger : result.fingers)
    TOUCHSTONE_RETURN_IF_ERROR(entry.Pose("base_from_tip", finger.base_from_tip));
  return absl::OkStatus();
}

absl::Status CheckSeries(const JournalSeries& kept, const std::string& where, const Entry& entry) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchSeries series, ParseSeries(kept, where));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Numbers("series/time_s", series.time_s(), kMaxSessionTimeS));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Numbers("series/joints_rad", series.joints_rad(), kMaxRotationRad));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Numbers("series/base_from_tip", series.base_from_tip(), kMaxPositionM));
  return entry.Numbers("series/tip_force_n", series.tip_force_n(), kMaxForceN);
}

absl::Status CheckImage(const JournalImage& image, const Entry& entry) {
  TOUCHSTONE_RETURN_IF_ERROR(entry.Text("id", image.id, kMaxIdBytes));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Text("object", image.object, kMaxObjectNameBytes));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Face(image.up_face));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Pose("base_from_camera", image.base_from_camera));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Pose("measured_base_from_camera", image.measured_base_from_camera));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("measured_unix_s", image.measured_unix_s, 0, kMaxUnixS));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("unix_s", image.unix_s, 0, kMaxUnixS));
  if (image.width < 1 || image.width > kMaxPictureSidePx || image.height < 1 ||
      image.height > kMaxPictureSidePx)
    return entry.Wrong(absl::StrCat("its size (", image.width, " x ", image.height,
                                    " px) is out of range; 1 to ", kMaxPictureSidePx,
                                    " px a side were expected"));
  const absl::StatusOr<image::PictureSize> size = image::PlainPngSize(image.png);
  if (!size.ok()) return entry.Wrong(size.status().message());
  if (size->width != image.width || size->height != image.height)
    return entry.Wrong(absl::StrCat("its picture has ", size->width, " x ", size->height, " px, not ",
                                    image.width, " x ", image.height));
  if (!image.view) return absl::OkStatus();
  const JournalView& view = *image.view;
  for (const auto* vector : {&view.eye_m, &view.at_m, &view.up})
    TOUCHSTONE_RETURN_IF_ERROR(entry.Numbers("its view", *vector, kMaxPositionM));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Pose("base_from_object", view.base_from_object));
  TOUCHSTONE_RETURN_IF_ERROR(entry.Number("session_time_s", view.session_time_s, 0, kMaxSessionTimeS));
  TOUCHSTONE_RETURN_IF_ERROR(
      entry.Numbers("its lens", std::array{view.fx_px, view.fy_px, view.cx_px, view.cy_px}, kMaxFocalPx));
  return entry.Numbers("distortion", view.distortion, std::numeric_limits<double>::max());
}

absl::Status CheckHead(const JournalSession& session, const std::string& origin) {
  if (!(session.created_unix_s >= 0 && session.created_unix_s <= kMaxUnixS))
    return absl::InvalidArgumentError(absl::StrCat(
        origin, ": created_unix_s (", ShortestNumber(session.created_unix_s), ") is out of range"));
  if (!(session.spacing_m > 0 && session.spacing_m <= kMaxPositionM))
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": spacing_m (", ShortestNumber(session.spacing_m), ") is out of range"));
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckSessionContent(const SessionContent& content, const std::string& origin) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckHead(content.session, origin));
  for (size_t k = 0; k < content.touches.size(); ++k) {
    const Entry entry(origin, "touch", k);
    TOUCHSTONE_RETURN_IF_ERROR(CheckTouch(content.touches[k], entry));
    if (k < content.series.size() && content.series[k])
      TOUCHSTONE_RETURN_IF_ERROR(CheckSeries(*content.series[k], absl::StrCat(origin, ": touch ", k), entry));
  }
  for (size_t k = 0; k < content.images.size(); ++k)
    TOUCHSTONE_RETURN_IF_ERROR(CheckImage(content.images[k], Entry(origin, "picture", k)));
  if (content.touches.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> measured,
                              MeasuredTouchesOf(content.touches, content.session.emulated, origin));
  return MakeMeasurementSet(measured, origin).status();
}

}  // namespace touchstone::session
