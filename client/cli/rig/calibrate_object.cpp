// touchstone rig calibrate object: where an object lies, from touches of its upper half.
#include <algorithm>
#include <cmath>
#include <limits>

#include "client/cli/common/progress_bar.h"
#include "client/cli/rig/calibrate.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/gateway/calibration/calibration.h"
#include "server/gateway/calibration/object_registration.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/supershape.h"
#include "server/service/core/convert.h"

namespace touchstone::cli {
namespace {

constexpr double kGoldenAngleRad = 2.399963229728653;
constexpr double kTiltsRad[] = {15 * kRadiansPerDegree, 30 * kRadiansPerDegree,
                                40 * kRadiansPerDegree};  // from straight down; all come from above
constexpr double kShareOfSides = 0.5;  // targets lie within this share of the box's half sides
constexpr double kHeight = 0.4;        // and this share of its half height above its middle
constexpr double kBeyondBoxM = 0.03;   // every finger starts so far outside the box
constexpr size_t kMaxTargetsShown = 5;
constexpr size_t kMinTouches = 6;
constexpr uint64_t kTriangles = 20000;

absl::StatusOr<std::shared_ptr<const geometry::Surface>> ReadSurface(const CalibrateOptions& options) {
  geometry::TriangleMesh mesh;
  if (!options.surface.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(mesh, geometry::ReadMeshFile(options.surface));
  } else {
    const absl::StatusOr<geometry::SupershapeParameters> shape = geometry::NamedSupershape(options.object);
    if (!shape.ok())
      return absl::InvalidArgumentError(absl::StrCat("--surface is missing: ", options.object,
                                                     " is no built-in shape, so its mesh file is needed"));
    TOUCHSTONE_ASSIGN_OR_RETURN(mesh, geometry::MakeSupershape(*shape, kTriangles));
  }
  return geometry::Surface::Create(options.object, std::move(mesh));
}

// The distance from a point within the box, along the direction, to where it leaves the box. Metres.
double DistanceToExit(const Eigen::Vector3d& point, const Eigen::Vector3d& direction,
                      const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  double distance_m = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) continue;
    const double side_m = direction[axis] > 0 ? high[axis] : low[axis];
    distance_m = std::min(distance_m, (side_m - point[axis]) / direction[axis]);
  }
  return std::max(distance_m, 0.0);
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
      (low + high) / 2 + Eigen::Vector3d(kShareOfSides * half.x() * round.x(),
                                         kShareOfSides * half.y() * round.y(), kHeight * half.z());
  v1::CommandedTouch touch;
  *touch.mutable_target_m() = service::ToProto(target);
  *touch.mutable_approach() = service::ToProto(approach);
  *touch.mutable_lateral() = service::ToProto(lateral);
  double exit_m = 0;
  for (const double reach_m : {-outer_finger_m, 0.0, outer_finger_m})
    exit_m = std::max(exit_m, DistanceToExit(target + reach_m * lateral, -approach, low, high));
  touch.set_standoff_m(exit_m + kBeyondBoxM);
  touch.set_speed_m_s(speed_m_s);
  return touch;
}

// The touches, those that the rig cannot reach marked, before anything moves.
absl::StatusOr<std::vector<PlannedRow>> PlanTouches(const Cli& cli, const CalibrateOptions& options,
                                                    client::Connection* connection, const v1::Object& object,
                                                    double outer_finger_m) {
  std::vector<PlannedRow> rows;
  std::vector<size_t> all;
  for (int k = 0; k < options.touches; ++k) {
    PlannedRow row;
    row.touch.object = options.object;
    row.touch.touch = k;
    row.touch.commanded =
        TouchOf(k, service::FromProto(object.bounds_min_m()), service::FromProto(object.bounds_max_m()),
                outer_finger_m, options.speed_mm_s / kMillimetresPerMetre);
    row.id = client::NewTouchId(k);
    all.push_back(rows.size());
    rows.push_back(std::move(row));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckRows(connection, all, &rows, nullptr, [] { return !Interrupt::Raised(); }));
  const std::string impossible = ImpossibleTable(rows, kMaxTargetsShown);
  if (!impossible.empty()) cli.Log(impossible + "these are left out");
  return rows;
}

// It stands on the fixture as in its mesh file all the time.
bool CanBeMade(const PlannedRow& row) {
  return row.possible && row.up_face == "+z";
}

struct MadeTouches {
  int touches = 0;
  std::vector<gateway::calibration::RegistrationContact> contacts;
};

absl::StatusOr<MadeTouches> MakeTouches(const Cli& cli, const CalibrateOptions& options,
                                        const RigConnection& rig, const v1::RigState& state,
                                        const std::vector<PlannedRow>& rows, double spacing_m) {
  ProgressBar bar(!cli.output().quiet);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const auto source, OpenLeased(cli, rig.connection.get(), options.motion, [&](const std::string& line) {
        bar.Clear();
        cli.Log(line);
      }));
  const StopOnInterrupt stop_on_interrupt(source.get());
  TOUCHSTONE_RETURN_IF_ERROR(MountForTouches(cli, source.get(), state, options.object, "+z"));
  MadeTouches made;
  for (const PlannedRow& row : rows) {
    if (!CanBeMade(row)) continue;
    bar.ShowStage(absl::StrCat("touch ", row.touch.touch + 1, " of ", rows.size()),
                  static_cast<double>(row.touch.touch) / rows.size());
    v1::TouchRequest request;
    request.set_object(options.object);
    request.set_session(options.motion.session.empty() ? "calibration" : options.motion.session);
    *request.add_touches() = row.touch.commanded;
    request.add_touch_ids(row.id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchResponse response, source->Touch(std::move(request)));
    ++made.touches;
    const v1::Measured& measured = response.results(0).measured();
    const int fingers = measured.base_from_tip_at_contact_size();
    for (int finger = 0; finger < fingers; ++finger) {
      if (!measured.base_from_tip_at_contact(finger).has_position_m()) continue;
      made.contacts.push_back(
          {PoseOf(measured.base_from_tip_at_contact(finger)), (finger - (fingers - 1) / 2.0) * spacing_m});
    }
  }
  bar.Clear();
  return made;
}

// What the registration found, for people and as JSON; `before` is where the object was assumed to lie.
void ReportRegistration(const Cli& cli, const CalibrateOptions& options,
                        const gateway::calibration::ObjectRegistration& fit, const Eigen::Isometry3d& before,
                        int touches) {
  const Eigen::Vector3d moved_m = fit.base_from_object.translation() - before.translation();
  const double turned_rad =
      Eigen::AngleAxisd(Eigen::Matrix3d(fit.base_from_object.linear() * before.linear().transpose())).angle();
  const Eigen::Vector3d error_m(fit.translation_std_error_m[0], fit.translation_std_error_m[1],
                                fit.translation_std_error_m[2]);
  const Eigen::Vector3d error_mm = error_m * kMillimetresPerMetre;
  const Eigen::Vector3d error_deg =
      Eigen::Vector3d(fit.rotation_std_error_rad[0], fit.rotation_std_error_rad[1],
                      fit.rotation_std_error_rad[2]) /
      kRadiansPerDegree;
  if (cli.output().json)
    PrintJson({{"calibration", options.output},
               {"touches", touches},
               {"contacts", fit.contacts},
               {"left_out", fit.left_out},
               {"rms_mm", fit.rms_m * kMillimetresPerMetre},
               {"translation_std_error_mm", {error_mm.x(), error_mm.y(), error_mm.z()}},
               {"rotation_std_error_deg", {error_deg.x(), error_deg.y(), error_deg.z()}}});
  cli.Log(absl::StrCat(options.output, ": ", options.object, " lies ", InMillimetres(moved_m), " mm and ",
                       Rounded(turned_rad / kRadiansPerDegree),
                       " deg from where it was written; standard errors ", InMillimetres(error_m), " mm and ",
                       Rounded(error_deg.x()), ", ", Rounded(error_deg.y()), ", ", Rounded(error_deg.z()),
                       " deg; ", fit.contacts, " contacts of ", touches, " touches, ", fit.left_out,
                       " left out, rms ", Rounded(fit.rms_m * kMillimetresPerMetre), " mm"));
  cli.Log("the gateway takes it when it is started with this file");
}

}  // namespace

absl::Status RunCalibrateObject(const Cli& cli, const CalibrateOptions& options) {
  if (options.object.empty())
    return absl::InvalidArgumentError("OBJECT is missing: what lies on the fixture?");
  if (options.calibration.empty())
    return absl::InvalidArgumentError("--calibration is missing: the file that the gateway runs with now");
  TOUCHSTONE_ASSIGN_OR_RETURN(gateway::calibration::Calibration calibration,
                              gateway::calibration::ReadCalibration(options.calibration));
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
        "note: the gateway's mesh of this object is not the built-in one of 20,000 triangles; "
        "--surface names its file");

  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, GetRig(rig.connection.get()));
  const double spacing_m =
      options.spacing_mm > 0 ? options.spacing_mm / kMillimetresPerMetre : state.spacing_m();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::vector<PlannedRow> rows,
      PlanTouches(cli, options, rig.connection.get(), object, (state.fingers() - 1) / 2.0 * spacing_m));
  const auto possible = static_cast<size_t>(std::count_if(rows.begin(), rows.end(), CanBeMade));
  if (possible < kMinTouches)
    return absl::FailedPreconditionError(absl::StrCat("the rig can make only ", possible, " of ", rows.size(),
                                                      " touches of ", options.object, ", ", kMinTouches,
                                                      " are needed, so nothing was moved"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const MadeTouches made, MakeTouches(cli, options, rig, state, rows, spacing_m));
  const Eigen::Isometry3d before = start->second;
  TOUCHSTONE_ASSIGN_OR_RETURN(const gateway::calibration::ObjectRegistration fit,
                              gateway::calibration::RegisterObject(*surface, made.contacts, before));

  calibration.base_from_object[options.object] = fit.base_from_object;
  calibration.notes["date"] = Today();
  calibration.notes["how"] = absl::StrCat(options.object, " from ", made.touches, " touches");
  calibration.notes["rms_mm " + options.object] = Rounded(fit.rms_m * kMillimetresPerMetre);
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, gateway::calibration::FormatCalibration(calibration)));
  ReportRegistration(cli, options, fit, before, made.touches);
  return absl::OkStatus();
}

}  // namespace touchstone::cli
