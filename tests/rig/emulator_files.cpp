#include "tests/rig/emulator_files.h"

#include <unistd.h>

#include <ctime>
#include <stdexcept>

#include <absl/strings/str_format.h>
#include <nlohmann/json.hpp>

#include "server/base/files/file_writer.h"
#include "server/base/text/text.h"
#include "server/geometry/pose.h"

namespace touchstone::rig {
namespace {

constexpr double kFixtureXM = 0.30, kFixtureYM = 0, kPlateZM = -0.075;

// A TOML basic string; JSON's escapes are a part of TOML's.
std::string Quoted(const std::string& text) {
  return nlohmann::json(text).dump();
}

std::string PoseText(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d mm = pose.translation() * 1e3,
                        deg = geometry::RotationVectorOf(pose.linear()) * (180 / M_PI);
  return absl::StrFormat("{translation_mm: [%.9g, %.9g, %.9g], rotation_deg: [%.9g, %.9g, %.9g]}", mm.x(),
                         mm.y(), mm.z(), deg.x(), deg.y(), deg.z());
}

void Write(const std::string& path, const std::string& text) {
  const absl::Status status = WriteFileAtomically(path, text);
  if (!status.ok()) throw std::runtime_error(std::string(status.message()));
}

}  // namespace

Eigen::Isometry3d FlangeFromTip() {
  return Eigen::Isometry3d(Eigen::Translation3d(0, 0, 0.12));
}

Eigen::Isometry3d FlangeFromCamera() {
  return Eigen::Isometry3d(Eigen::Translation3d(0, 0.06, 0.04));
}

Eigen::Isometry3d FixtureOf(const Eigen::Vector3d& box_min_m, const Eigen::Vector3d& box_max_m) {
  const Eigen::Vector3d centre = 0.5 * (box_min_m + box_max_m);
  const Eigen::Vector3d place(kFixtureXM - centre.x(), kFixtureYM - centre.y(), kPlateZM - box_min_m.z());
  // Whole micrometres, so that the calibration file tells the truth to the last digit.
  return Eigen::Isometry3d(Eigen::Translation3d((place * 1e6).array().round().matrix() * 1e-6));
}

std::string ClockFile(const EmulatorOptions& options) {
  return options.dir + "/clock";
}

void WriteCalibration(const EmulatorOptions& options,
                      const std::map<std::string, Eigen::Isometry3d>& base_from_object) {
  std::string text = std::string("# ") + kNotice + ".\ntouchstone: calibration/1\n" +
                     "flange_from_tip: " + PoseText(FlangeFromTip()) +
                     "\nflange_from_camera: " + PoseText(FlangeFromCamera()) + "\nbase_from_object:\n";
  for (const auto& [name, pose] : base_from_object) text += "  " + name + ": " + PoseText(pose) + "\n";
  const std::time_t now = std::time(nullptr);
  std::tm date{};
  gmtime_r(&now, &date);
  char day[16];
  std::strftime(day, sizeof day, "%Y-%m-%d", &date);
  text += std::string("made: {date: ") + day + ", how: \"true poses of the emulated rig\"}\n";
  Write(options.dir + "/calibration.yaml", text);
}

void WriteGatewayConfig(const EmulatorOptions& options, const EmulatorAddresses& addresses) {
  const std::string& dir = options.dir;
  const std::string control = options.address + ":" + std::to_string(addresses.control_port);
  std::string text =
      std::string("# For touchstone-gateway, written by touchstone-rig-emulator (") + kNotice + ").\n";
  text += "listen = \"127.0.0.1:0\"\n";
  text += "journal = " + Quoted(dir + "/rig.db") + "\n";
  text += "audit_log = " + Quoted(dir + "/audit.jsonl") + "\n";
  text += "calibration = " + Quoted(dir + "/calibration.yaml") + "\n";
  text += "provenance_note = \"emulated rig: not a measurement of anything\"\nemulated = true\n";
  text += absl::StrFormat("time_scale = %.9g\n", options.speedup);
  text += "emulated_clock = " + Quoted(ClockFile(options)) + "\n";
  if (!addresses.program.empty())
    text += "mount_command = [" + Quoted(addresses.program) + ", \"tell\", " + Quoted(control) +
            ", \"mount\", \"{object}\", \"{up_face}\"]\n";
  if (!options.meshes.empty()) {
    text += "mesh = [";
    for (size_t k = 0; k < options.meshes.size(); ++k)
      text += (k > 0 ? ", " : "") + Quoted(options.meshes[k]);
    text += "]\n";
  }
  text += absl::StrFormat(
      "\n[arm]\nmodel = %s\naddress = %s\ndashboard_port = %d\nprimary_port = %d\nsecondary_port = "
      "%d\nrtde_port = %d\n",
      Quoted(options.arm), Quoted(options.address), addresses.arm.dashboard, addresses.arm.primary,
      addresses.arm.secondary, addresses.arm.rtde);
  // The watchdog counts host time, and a busy host may leave the gateway without the processor for a while; only an
  // arm that could hurt somebody needs it sooner.
  if (options.speedup > 1) text += "watchdog_hz = 0.5\n";
  text += absl::StrFormat(
      "\n[effector]\nport = %s\nbaud = 115200\nfingers = %d\nspacing_mm = %.9g\nsensor = %s\n",
      Quoted(dir + "/effector"), options.fingers, options.spacing_mm, Quoted(options.sensor));
  if (options.camera)
    text += absl::StrFormat(
        "\n[camera]\nuri = %s\nvertical_fov_deg = %.9g\n",
        Quoted("http://" + options.address + ":" + std::to_string(addresses.camera_port) + "/video.mjpg"),
        kVerticalFovDeg);
  // The plate lies below the arm's base, and an approach may be told to end just above it.
  text += absl::StrFormat("\n[limits]\nbox_min_mm = [-500, -500, %.9g]\npayload_cog_mm = [0, 0, 45]\n",
                          kPlateZM * 1e3);
  Write(dir + "/gateway.toml", text);
}

void WriteAddresses(const EmulatorOptions& options, const EmulatorAddresses& addresses) {
  const nlohmann::ordered_json json = {
      {"notice", kNotice},
      {"pid", getpid()},
      {"arm",
       {{"model", options.arm},
        {"address", options.address},
        {"dashboard_port", addresses.arm.dashboard},
        {"primary_port", addresses.arm.primary},
        {"secondary_port", addresses.arm.secondary},
        {"realtime_port", addresses.arm.realtime},
        {"rtde_port", addresses.arm.rtde}}},
      {"effector",
       {{"port", options.dir + "/effector"}, {"sensor", options.sensor}, {"fingers", options.fingers}}},
      {"camera", {{"port", addresses.camera_port}}},
      {"control", {{"port", addresses.control_port}}},
      {"speedup", options.speedup},
      {"seed", options.seed},
      {"sigma_us", options.sigma_us},
      {"hidden", options.hide},
      {"unlisted", options.unlisted}};
  Write(options.dir + "/emulator.json", json.dump(2) + "\n");
}

}  // namespace touchstone::rig
