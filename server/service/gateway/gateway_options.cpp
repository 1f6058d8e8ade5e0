#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/service/core/resources.h"
#include "server/service/gateway/gateway_options.h"
#include "server/service/options/access_options.h"
#include "server/service/options/option_table.h"

namespace touchstone::service {
namespace {

// Options in the units of files, and lists that become arrays, before they are checked.
struct RawGatewayFlags {
  std::vector<std::string> mesh, mesh_dir;
  std::vector<std::string> sensor;
  int fingers = 3;
  bool active_high = true;
  double debounce_ms = 5;
  int threshold = 512, hysteresis = 16;
  double vertical_fov_deg = 45;
  double min_speed_mm_s = 0.1, arm_margin_mm = 45, max_arm_speed_mm_s = 250;
  double max_speed_mm_s = 100, transit_speed_mm_s = 150, acceleration_mm_s2 = 1200;
  double max_standoff_mm = 150, stroke_beyond_target_mm = 30, max_tilt_deg = 60, clearance_mm = 50;
  std::vector<double> payload_cog_mm, box_min_mm, box_max_mm, arm_box_min_mm, arm_box_max_mm, joint_min_deg,
      joint_max_deg, home_deg;
};

std::vector<Option> OptionsOf(GatewayFlags* flags, RawGatewayFlags* raw) {
  GatewayOptions& o = flags->options;
  std::vector<Option> options = {
      {"listen", "Address to listen on, HOST:PORT; port 0: any free one", &o.common.listen},
      {"replay", "Serve this journal, or the bug report of touchstone rig bundle, instead of a rig",
       &o.replay},
      {"journal", "The SQLite file that keeps every touch", &o.journal},
      {"audit_log", "JSON lines of what was done with the rig, and by whom; empty: none", &o.audit_log},
      {"calibration", "Where tool, objects and camera stand (YAML)", &o.calibration},
      {"provenance_note", "Kept with every session, for people", &o.provenance_note, "source_note"},
      {"emulated", "An emulator is in the rig's place: every session is marked, and so is every report of it",
       &o.emulated},
      {"time_scale", "Rig seconds in one second: 1, but with an emulator on a faster clock", &o.time_scale},
      {"emulated_clock", "The clock of an emulated rig, a file that the emulator keeps; empty: this host's",
       &o.emulated_clock},
      {"mount_command",
       "Program and arguments that put {object} down with its face {up_face} up; none: a person does",
       &o.mount_command},
      {"mount_timeout_s", "Seconds that it may take", &o.mount_timeout_s},
      {"mesh", "An object that can be touched, NAME=FILE[,unit=..][,up=..][,scale=..]; may be repeated",
       &raw->mesh},
      {"mesh_dir", "Every mesh file of a folder; may be repeated", &raw->mesh_dir},
      {"supershape_triangles", "About how many triangles each built-in supershape has",
       &o.common.supershape_triangles},
      {"arm.model", "ur3 (CB3), ur3e, ur5e or ur10e", &o.arm.model},
      {"arm.address", "Host name or address of the controller", &o.arm.address},
      {"arm.dashboard_port", "", &o.arm.dashboard_port},
      {"arm.primary_port", "", &o.arm.primary_port},
      {"arm.secondary_port", "", &o.arm.secondary_port},
      {"arm.rtde_port", "", &o.arm.rtde_port},
      {"arm.silence_s", "Seconds without a state after which the controller counts as frozen",
       &o.arm.silence_s},
      {"arm.watchdog_hz", "The controller stops the arm when this gateway sends heartbeats more slowly",
       &o.arm.watchdog_hz},
      {"effector.port", "Serial port of the end effector, /dev/ttyACM0", &o.effector.port},
      {"effector.baud", "", &o.effector.baud},
      {"effector.fingers", "1 to 8", &raw->fingers},
      {"effector.spacing_mm", "Between neighbouring fingers", &o.spacing_mm},
      {"effector.sensor", "optical, microswitch or resistor: one for all fingers, or one each", &raw->sensor},
      {"effector.active_high", "Optical, microswitch: the pin is high while pressed", &raw->active_high},
      {"effector.debounce_ms", "Microswitch", &raw->debounce_ms},
      {"effector.threshold", "Resistor: pressed at or above this reading", &raw->threshold},
      {"effector.hysteresis", "Resistor: released so far below", &raw->hysteresis},
      {"effector.max_overtravel_mm",
       "How far the first finger may be indented while the others have no contact", &o.max_overtravel_mm,
       "effector.max_press_mm"},
      {"effector.reply_timeout_s", "Of one try of a request", &o.effector.reply_timeout_s},
      {"effector.silence_s", "Without a heartbeat for so long the line is lost", &o.effector.silence_s},
      {"effector.clock_query_s", "Between two queries of its clock", &o.effector.clock_query_s},
      {"camera.uri", "'' none; 0 or /dev/video0; folder:PATH; video:FILE; http://...", &o.camera.uri,
       "camera.source"},
      {"camera.width", "Asked of the camera; 0: as it comes", &o.camera.width},
      {"camera.height", "", &o.camera.height},
      {"camera.intrinsics", "OpenCV's calibration file; empty: the field of view below",
       &o.camera.intrinsics},
      {"camera.vertical_fov_deg", "", &raw->vertical_fov_deg},
      {"camera.timeout_s", "", &o.camera.timeout_s},
      {"camera.latency_s", "From a picture's exposure until it is here; older ones are thrown away",
       &o.camera.latency_s},
      {"camera.pose_tolerance_mm", "A photograph from farther off its commanded pose is refused",
       &o.pose_tolerance_mm},
      {"camera.pose_tolerance_deg", "The same of its direction", &o.pose_tolerance_deg},
      {"limits.max_speed_mm_s", "Limit of an approach's speed", &raw->max_speed_mm_s},
      {"limits.min_speed_mm_s", "The least speed of an approach", &raw->min_speed_mm_s},
      {"limits.transit_speed_mm_s", "Speed between touches", &raw->transit_speed_mm_s,
       "limits.transfer_speed_mm_s"},
      {"limits.acceleration_mm_s2", "", &raw->acceleration_mm_s2},
      {"limits.max_standoff_mm", "", &raw->max_standoff_mm},
      {"limits.stroke_beyond_target_mm", "An approach ends so far behind its target",
       &raw->stroke_beyond_target_mm},
      {"limits.max_tilt_deg", "Of an approach, from straight down", &raw->max_tilt_deg},
      {"limits.clearance_mm", "Transits cross so far above the object", &raw->clearance_mm},
      {"limits.box_min_mm", "Corner of the box that the tip must stay in, base frame", &raw->box_min_mm},
      {"limits.box_max_mm", "Its other corner", &raw->box_max_mm},
      {"limits.arm_box_min_mm",
       "Corner of the box that elbow, wrist, flange and camera must stay in; none: the tips' floor, no walls",
       &raw->arm_box_min_mm},
      {"limits.arm_box_max_mm", "Its other corner", &raw->arm_box_max_mm},
      {"limits.arm_margin_mm", "They stay so far inside it: about the radius of the arm's links",
       &raw->arm_margin_mm},
      {"limits.max_arm_speed_mm_s", "Of elbow, wrist, flange and camera in any motion",
       &raw->max_arm_speed_mm_s},
      {"limits.max_force_n",
       "Force on the tip, beyond what is felt at rest before a motion, at which it is stopped",
       &o.limits.max_force_n},
      {"limits.joint_min_deg", "Six joints", &raw->joint_min_deg},
      {"limits.joint_max_deg", "Six joints", &raw->joint_max_deg},
      {"limits.home_deg", "Six joints", &raw->home_deg},
      {"limits.payload_kg", "Of the end effector", &o.limits.payload_kg},
      {"limits.payload_cog_mm",
       "Its centre of gravity, flange frame; none: that of the controller's installation stays",
       &raw->payload_cog_mm},
      {"lease_window_s", "Seconds within which a lease must be renewed", &o.common.lease_window_s},
      {"metrics", "Counters for Prometheus and probes over HTTP, HOST:PORT (default: none)",
       &o.common.metrics},
      {"log_level", "trace, debug, info, warn, error or off", &flags->log_level},
      {"log_json", "Log lines as JSON", &flags->log_json},
  };
  const std::vector<Option> access = AccessFlags(&o.common.access);
  options.insert(options.begin() + 1, access.begin(), access.end());
  AppendLimits(&o.common, &options);
  return options;
}

// `count` numbers in the unit of files into SI; none given: `numbers` stays.
template <typename Array>
absl::Status TakeList(const std::vector<double>& list, double si_per_unit, const char* key, Array* numbers) {
  if (list.empty()) return absl::OkStatus();
  if (list.size() != static_cast<size_t>(numbers->size()))
    return absl::InvalidArgumentError(
        absl::StrCat(key, " has ", list.size(), " numbers: ", numbers->size(), " would be right"));
  for (size_t k = 0; k < list.size(); ++k) (*numbers)[k] = list[k] * si_per_unit;
  return absl::OkStatus();
}

absl::Status Resolve(const RawGatewayFlags& raw, GatewayFlags* flags) {
  GatewayOptions& o = flags->options;
  for (const std::string& folder : raw.mesh_dir) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<source::MeshSpec> sources, MeshSpecsOfFolder(folder));
    o.common.meshes.insert(o.common.meshes.end(), sources.begin(), sources.end());
  }
  for (const std::string& text : raw.mesh) {
    TOUCHSTONE_ASSIGN_OR_RETURN(source::MeshSpec source, ParseMeshSpec(text));
    o.common.meshes.push_back(std::move(source));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(raw.fingers, 1, 8, "effector.fingers"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.spacing_mm, 1, 1000, "effector.spacing_mm"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.max_overtravel_mm, 0.1, 1000, "effector.max_overtravel_mm"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.time_scale, 1e-3, 1e5, "time_scale"));
  // Limits of time before a real arm are those of a clock that nothing holds up.
  if (!o.emulated_clock.empty() && !IsLocalAddress(absl::StrCat(o.arm.address, ":1")))
    return absl::InvalidArgumentError(
        absl::StrCat("emulated_clock is for an emulated rig on this machine, but arm.address is '",
                     o.arm.address, "': leave emulated_clock out before a real arm"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.arm.silence_s, 0.05, 60, "arm.silence_s"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.arm.watchdog_hz, 0.1, 50, "arm.watchdog_hz"));
  if (raw.sensor.size() > 1 && static_cast<int>(raw.sensor.size()) != raw.fingers)
    return absl::InvalidArgumentError(absl::StrCat("effector.sensor has ", raw.sensor.size(),
                                                   " names: one, or one for each of ", raw.fingers,
                                                   " fingers"));
  gateway::effector::EffectorFinger finger;
  finger.active_high = raw.active_high;
  finger.debounce_s = raw.debounce_ms / 1000;
  finger.threshold = raw.threshold;
  finger.hysteresis = raw.hysteresis;
  o.effector.fingers.assign(raw.fingers, finger);
  for (int k = 0; k < raw.fingers && !raw.sensor.empty(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        o.effector.fingers[k].sensor,
        gateway::effector::ParseSensor(raw.sensor[raw.sensor.size() == 1 ? 0 : k],
                                       absl::StrCat("effector.sensor: finger ", k + 1)));
  }
  o.effector.time_scale = o.time_scale;
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.pose_tolerance_mm, 1e-3, 100, "camera.pose_tolerance_mm"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(o.pose_tolerance_deg, 1e-3, 90, "camera.pose_tolerance_deg"));

  o.camera.vertical_fov_rad = raw.vertical_fov_deg * kRadiansPerDegree;
  gateway::arm::MotionLimits& limits = o.limits;
  limits.min_speed_m_s = raw.min_speed_mm_s / 1000;
  limits.arm_margin_m = raw.arm_margin_mm / 1000;
  limits.max_arm_speed_m_s = raw.max_arm_speed_mm_s / 1000;
  limits.max_speed_m_s = raw.max_speed_mm_s / 1000;
  limits.transit_speed_m_s = raw.transit_speed_mm_s / 1000;
  limits.acceleration_m_s2 = raw.acceleration_mm_s2 / 1000;
  limits.max_standoff_m = raw.max_standoff_mm / 1000;
  limits.stroke_beyond_target_m = raw.stroke_beyond_target_mm / 1000;
  limits.max_tilt_rad = raw.max_tilt_deg * kRadiansPerDegree;
  limits.clearance_m = raw.clearance_mm / 1000;
  if (!raw.payload_cog_mm.empty())
    TOUCHSTONE_RETURN_IF_ERROR(TakeList(raw.payload_cog_mm, 1e-3, "limits.payload_cog_mm",
                                        &limits.payload_cog_m.emplace(Eigen::Vector3d::Zero())));
  TOUCHSTONE_RETURN_IF_ERROR(TakeList(raw.box_min_mm, 1e-3, "limits.box_min_mm", &limits.box_min_m));
  TOUCHSTONE_RETURN_IF_ERROR(TakeList(raw.box_max_mm, 1e-3, "limits.box_max_mm", &limits.box_max_m));
  TOUCHSTONE_RETURN_IF_ERROR(
      TakeList(raw.arm_box_min_mm, 1e-3, "limits.arm_box_min_mm", &limits.arm_box_min_m));
  TOUCHSTONE_RETURN_IF_ERROR(
      TakeList(raw.arm_box_max_mm, 1e-3, "limits.arm_box_max_mm", &limits.arm_box_max_m));
  TOUCHSTONE_RETURN_IF_ERROR(
      TakeList(raw.joint_min_deg, kRadiansPerDegree, "limits.joint_min_deg", &limits.joint_min_rad));
  TOUCHSTONE_RETURN_IF_ERROR(
      TakeList(raw.joint_max_deg, kRadiansPerDegree, "limits.joint_max_deg", &limits.joint_max_rad));
  TOUCHSTONE_RETURN_IF_ERROR(TakeList(raw.home_deg, kRadiansPerDegree, "limits.home_deg", &limits.home_rad));

  TOUCHSTONE_RETURN_IF_ERROR(CheckLogLevel(flags->log_level));
  if (o.replay.empty() && (o.arm.address.empty() || o.effector.port.empty()))
    return absl::InvalidArgumentError(
        "arm.address and effector.port say where the rig is: give --config FILE, or both; --replay FILE "
        "serves a "
        "recorded session instead");
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<GatewayFlags> ParseGatewayFlags(int argc, const char* const* argv) {
  GatewayFlags flags;
  RawGatewayFlags raw;
  const std::vector<Option> options = OptionsOf(&flags, &raw);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const CommandLine line,
      ReadCommandLine(
          "touchstone-gateway",
          "Examples:\n"
          "  touchstone-gateway --config rig.toml\n"
          "  touchstone-gateway --arm-address 192.168.0.10 --arm-model ur3e --effector-port /dev/ttyACM0\n"
          "  touchstone-gateway --replay session.db\n"
          "  touchstone-gateway --replay bug.tar.gz\n"
          "\nThe physical source: drives a UR3 arm, the end effector and a camera behind the same services "
          "as\n"
          "touchstone-server. It prints 'listening on HOST:PORT' when it is ready. Its stop is a software "
          "stop "
          "and\n"
          "not safety-rated: keep the emergency stop within reach.",
          "TOML file; its keys are the flags below: arm.address = --arm-address", options, argc, argv));
  flags.done = line.done;
  if (line.done) return flags;
  if (!line.config.empty()) {
    const std::filesystem::path folder = std::filesystem::path(line.config).parent_path();
    for (const auto& [key, path] :
         {std::pair("journal", &flags.options.journal), std::pair("audit_log", &flags.options.audit_log),
          std::pair("calibration", &flags.options.calibration), std::pair("replay", &flags.options.replay),
          std::pair("emulated_clock", &flags.options.emulated_clock),
          std::pair("camera.intrinsics", &flags.options.camera.intrinsics),
          std::pair("tls_cert", &flags.options.common.access.tls_cert),
          std::pair("tls_key", &flags.options.common.access.tls_key),
          std::pair("tls_client_ca", &flags.options.common.access.tls_client_ca),
          std::pair("token_file", &flags.options.common.access.token_file)})
      if (line.given.count(key) == 0 && !path->empty()) *path = (folder / *path).string();
  }
  TOUCHSTONE_RETURN_IF_ERROR(Resolve(raw, &flags));
  return flags;
}

}  // namespace touchstone::service
