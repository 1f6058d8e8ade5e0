// touchstone rig calibrate object: where an object lies, from touches of its upper half.
#include <algorithm>
#include <cmath>
#include <limits>

#include "client/cli/progress_bar.h"
#include "client/cli/rig_calibrate.h"
#include "client/source/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/object_registration.h"
#include "server/geometry/mesh_file.h"
#include "server/geometry/supershape.h"
#include "server/service/convert.h"

namespace touchstone::cli {
namespace {

constexpr double kMilli = 1e3;
constexpr double kDegree = M_PI / 180;
constexpr double kGoldenAngleRad = 2.399963229728653;
constexpr double kTiltsRad[] = {15 * kDegree, 30 * kDegree,
                                40 * kDegree};  // from straight down; all come from above
constexpr double kSpread = 0.5;                 // targets lie within this share of the box's half sides
constexpr double kHeight = 0.4;                 // and this share of its half height above its middle
constexpr double kBeyondBoxM = 0.03;            // every finger starts so far outside the box
constexpr size_t kMaxLines = 5;
constexpr size_t kMinTouches = 6;
constexpr uint64_t kTriangles = 20000;

absl::StatusOr<std::shared_ptr<const Surface>> ReadSurface(const CalibrateOptions& options) {
  TriangleMesh mesh;
  if (!options.surface.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(mesh, ReadMeshFile(options.surface));
  } else {
    const absl::StatusOr<SupershapeParameters> shape = NamedSupershape(options.object);
    if (!shape.ok())
      return absl::InvalidArgumentError(absl::StrCat("--surface is missing: ", options.object,
                                                     " is no built-in shape, so its mesh file is needed"));
    TOUCHSTONE_ASSIGN_OR_RETURN(mesh, MakeSupershape(*shape, kTriangles));
  }
  return Surface::Create(options.object, std::move(mesh));
}

// How far one goes from a point within the box, along the direction, until outside.
double WayOut(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, const Eigen::Vector3d& low,
              const Eigen::Vector3d& high) {
  double way_m = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) continue;
    const double side_m = direction[axis] > 0 ? high[axis] : low[axis];
    way_m = std::min(way_m, (side_m - point[axis]) / direction[axis]);
  }
  return std::max(way_m, 0.0);
}

// From all sides and above, the hand turned along and across, so that every direction of the object shows.
v1::CommandedTouch TouchOf(int k, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                           double outer_finger_m, double speed_m_s) {
  const double tilt_rad = kTiltsRad[k % 3], azimuth_rad = k * kGoldenAngleRad;
  const Eigen::Vector3d half = (high - low) / 2;
  const Eigen::Vector3d round(std::cos(azimuth_rad), std::sin(azimuth_rad), 0);
  const Eigen::Vector3d approach =
      -(std::cos(tilt_rad) * Eigen::Vector3d::UnitZ() + std::sin(tilt_rad) * round);
  const Eigen::Vector3d across(-round.y(), round.x(), 0);
  const Eigen::Vector3d lateral = k % 2 == 0 ? across : across.cross(approach);
  const Eigen::Vector3d target =
      (low + high) / 2 +
      Eigen::Vector3d(kSpread * half.x() * round.x(), kSpread * half.y() * round.y(), kHeight * half.z());
  v1::CommandedTouch touch;
  *touch.mutable_target_m() = ToProto(target);
  *touch.mutable_approach() = ToProto(approach);
  *touch.mutable_lateral() = ToProto(lateral);
  double way_out_m = 0;
  for (const double reach_m : {-outer_finger_m, 0.0, outer_finger_m})
    way_out_m = std::max(way_out_m, WayOut(target + reach_m * lateral, -approach, low, high));
  touch.set_standoff_m(way_out_m + kBeyondBoxM);
  touch.set_speed_m_s(speed_m_s);
  return touch;
}

}  // namespace

absl::Status RunCalibrateObject(const Cli& cli, const CalibrateOptions& options) {
  if (options.object.empty())
    return absl::InvalidArgumentError("OBJECT is missing: what lies on the fixture?");
  if (options.calibration.empty())
    return absl::InvalidArgumentError("--calibration is missing: the file that the gateway runs with now");
  TOUCHSTONE_RETURN_IF_ERROR(CheckNewFile(options.output));
  TOUCHSTONE_ASSIGN_OR_RETURN(Calibration calibration, ReadCalibration(options.calibration));
  const auto start = calibration.base_from_object.find(options.object);
  if (start == calibration.base_from_object.end())
    return absl::InvalidArgumentError(
        absl::StrCat(options.calibration, ": base_from_object has no '", options.object,
                     "'; measure roughly (5 mm, 3 deg) where it lies and write it there first"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto surface, ReadSurface(options));
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Object object, FindObject(rig.connection.get(), options.object));
  if (options.surface.empty() && object.mesh_hash() != surface->hash())
    cli.Log(
        "note: the gateway's mesh of this object is not the built-in one of 20,000 triangles; --surface "
        "names its "
        "file");

  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
  const double spacing_m = options.spacing_mm > 0 ? options.spacing_mm / kMilli : state.spacing_m();
  // What the rig cannot reach is left out before anything moves.
  std::vector<PlannedRow> rows;
  std::vector<size_t> all;
  for (int k = 0; k < options.touches; ++k) {
    PlannedRow row;
    row.touch.object = options.object;
    row.touch.touch = k;
    row.touch.commanded = TouchOf(k, FromProto(object.bounds_min_m()), FromProto(object.bounds_max_m()),
                                  (state.fingers() - 1) / 2.0 * spacing_m, options.speed_mm_s / kMilli);
    row.id = client::NewTouchId(k);
    all.push_back(rows.size());
    rows.push_back(std::move(row));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckRows(rig.connection.get(), all, &rows, nullptr));
  const std::string impossible = ImpossibleTable(rows, kMaxLines);
  if (!impossible.empty()) cli.Log(impossible + "these are left out");
  const auto makes = [](const PlannedRow& row) { return row.possible && row.up_face == "+z"; };
  if (std::count_if(rows.begin(), rows.end(), makes) < static_cast<int>(kMinTouches))
    return absl::FailedPreconditionError(absl::StrCat(
        "the rig can make only ", std::count_if(rows.begin(), rows.end(), makes), " of ", rows.size(),
        " touches of ", options.object, ", ", kMinTouches, " are needed, so nothing was moved"));

  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const auto source, OpenLeased(cli, rig.connection.get(), options.motion, [&](const std::string& line) {
        bar.Clear();
        cli.Log(line);
      }));
  const StopOnInterrupt stop_on_interrupt(source.get());
  TOUCHSTONE_RETURN_IF_ERROR(MountForTouches(cli, source.get(), state, options.object, "+z"));
  std::vector<RegistrationContact> contacts;
  int made = 0;
  for (const PlannedRow& row : rows) {
    if (!makes(row)) continue;
    bar.ShowStage(absl::StrCat("touch ", row.touch.touch + 1, " of ", rows.size()),
                  static_cast<double>(row.touch.touch) / rows.size());
    v1::TouchRequest request;
    request.set_object(options.object);
    request.set_session(options.motion.session.empty() ? "calibration" : options.motion.session);
    *request.add_touches() = row.touch.commanded;
    request.add_touch_ids(row.id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchResponse response, source->Touch(std::move(request)));
    ++made;
    const v1::Measured& measured = response.results(0).measured();
    const int fingers = measured.base_from_tip_at_contact_size();
    for (int finger = 0; finger < fingers; ++finger) {
      if (!measured.base_from_tip_at_contact(finger).has_position_m()) continue;
      contacts.push_back(
          {PoseOf(measured.base_from_tip_at_contact(finger)), (finger - (fingers - 1) / 2.0) * spacing_m});
    }
  }
  bar.Clear();
  TOUCHSTONE_ASSIGN_OR_RETURN(const ObjectRegistration fit,
                              RegisterObject(*surface, contacts, start->second));

  const Eigen::Vector3d moved_m = fit.base_from_object.translation() - start->second.translation();
  const double turned_rad =
      Eigen::AngleAxisd(Eigen::Matrix3d(fit.base_from_object.linear() * start->second.linear().transpose()))
          .angle();
  const Eigen::Vector3d error_m(fit.translation_std_error_m[0], fit.translation_std_error_m[1],
                                fit.translation_std_error_m[2]);
  const Eigen::Vector3d error_deg =
      Eigen::Vector3d(fit.rotation_std_error_rad[0], fit.rotation_std_error_rad[1],
                      fit.rotation_std_error_rad[2]) /
      kDegree;
  calibration.base_from_object[options.object] = fit.base_from_object;
  calibration.notes["date"] = Today();
  calibration.notes["how"] = absl::StrCat(options.object, " from ", made, " touches");
  calibration.notes["rms_mm " + options.object] = Rounded(fit.rms_m * kMilli);
  TOUCHSTONE_RETURN_IF_ERROR(WriteFileAtomically(options.output, FormatCalibration(calibration)));
  if (cli.output().json)
    PrintJson(
        {{"calibration", options.output},
         {"touches", made},
         {"contacts", fit.contacts},
         {"left_out", fit.left_out},
         {"rms_mm", fit.rms_m * kMilli},
         {"translation_std_error_mm", {error_m.x() * kMilli, error_m.y() * kMilli, error_m.z() * kMilli}},
         {"rotation_std_error_deg", {error_deg.x(), error_deg.y(), error_deg.z()}}});
  cli.Log(absl::StrCat(options.output, ": ", options.object, " lies ", InMillimetres(moved_m), " mm and ",
                       Rounded(turned_rad / kDegree), " deg from where it was written; standard errors ",
                       InMillimetres(error_m), " mm and ", Rounded(error_deg.x()), ", ",
                       Rounded(error_deg.y()), ", ", Rounded(error_deg.z()), " deg; ", fit.contacts,
                       " contacts of ", made, " touches, ", fit.left_out, " left out, rms ",
                       Rounded(fit.rms_m * kMilli), " mm"));
  cli.Log("the gateway takes it when it is started with this file");
  return absl::OkStatus();
}

}  // namespace touchstone::cli
