#include "tests/rig/controller/protocol/primary_packets.h"

#include <cmath>

#include "tests/rig/controller/network/wire.h"

namespace touchstone::rig {
namespace {

// Rotation limits that a packet can hold for a joint without one.
double Finite(double value) {
  return std::isfinite(value) ? value : 2 * 3.14159265358979323846;
}

std::string Sized(uint8_t type, const std::string& body) {
  WireWriter to;
  to.Put(static_cast<uint32_t>(5 + body.size())).Put(type).Text(body);
  return to.bytes;
}

std::string Message(double now_s, uint8_t source, uint8_t kind, const std::string& body) {
  WireWriter to;
  to.Put(static_cast<uint64_t>(now_s * 1e6)).Put(source).Put(kind).Text(body);
  return Sized(20, to.bytes);
}

}  // namespace

std::string VersionPacket(const std::string& model) {
  const bool e_series = model == "ur3e";
  const std::string project = "URControl";
  WireWriter to;
  to.Put(static_cast<uint8_t>(project.size())).Text(project);
  to.Put(static_cast<uint8_t>(e_series ? 5 : 3)).Put(static_cast<uint8_t>(e_series ? 11 : 15));
  to.Put(int32_t{e_series ? 0 : 8}).Put(int32_t{e_series ? 108249 : 106339});
  to.Text(e_series ? "01-09-2021, 00:00:00" : "20-06-2022, 00:00:00");
  return Message(0, 254, 3, to.bytes);
}

std::string AnnouncementPacket(const Announcement& announcement, double now_s) {
  WireWriter to;
  switch (announcement.kind) {
    case Announcement::kText:
      break;
    case Announcement::kPopup:
      to.Put(uint32_t{0}).Put(uint8_t{0});
      to.Put(static_cast<uint8_t>(announcement.first))
          .Put(static_cast<uint8_t>(announcement.second))
          .Put(uint8_t{0});
      to.Put(static_cast<uint8_t>(announcement.title.size())).Text(announcement.title);
      break;
    case Announcement::kError:  // report level 3 (violation), no data
      to.Put(int32_t{announcement.first}).Put(int32_t{announcement.second}).Put(int32_t{3});
      to.Put(uint32_t{0}).Put(uint32_t{0});
      break;
    case Announcement::kKey:
      to.Put(int32_t{0}).Put(int32_t{0});
      to.Put(static_cast<uint8_t>(announcement.title.size())).Text(announcement.title);
      break;
    case Announcement::kException:
      to.Put(int32_t{announcement.first}).Put(int32_t{announcement.second});
      break;
  }
  to.Text(announcement.text);
  return Message(now_s, 253, static_cast<uint8_t>(announcement.kind), to.bytes);
}

std::string StatePacket(const RobotState& state, const ArmGeometry& arm, const std::string& model) {
  const bool e_series = model == "ur3e";
  const auto flag = [](bool on) { return static_cast<uint8_t>(on); };

  WireWriter mode;
  mode.Put(static_cast<uint64_t>(state.timestamp_s * 1e6));
  mode.Put(flag(true)).Put(flag(true)).Put(flag(state.robot_mode >= kPowerOn));
  mode.Put(flag(state.safety_mode == kRobotEmergencyStop)).Put(flag(state.safety_mode == kProtectiveStop));
  mode.Put(flag(state.program_running)).Put(flag(false));
  mode.Put(static_cast<uint8_t>(state.robot_mode)).Put(uint8_t{0});
  mode.Put(state.target_speed_fraction).Put(state.speed_scaling).Put(1.0).Put(uint8_t{0});

  WireWriter joints;
  const uint8_t joint_mode = state.robot_mode == kRunning ? 253 : state.robot_mode == kIdle ? 255 : 239;
  for (int i = 0; i < 6; ++i) {
    joints.Put(state.actual_q[i]).Put(state.target_q[i]).Put(state.actual_qd[i]);
    joints.Put(0.0f).Put(48.0f).Put(28.0f).Put(28.0f).Put(joint_mode);
  }

  WireWriter cartesian;
  cartesian.PutAll(state.actual_tcp_pose).PutAll(state.tcp_offset);

  WireWriter kinematics;
  for (int i = 0; i < 6; ++i) kinematics.Put(uint32_t{0});  // checksums of the calibration
  kinematics.PutAll(arm.theta_rad).PutAll(arm.a_m).PutAll(arm.d_m).PutAll(arm.alpha_rad);
  kinematics.Put(uint32_t{0});  // calibrated

  WireWriter configuration;
  for (const double angle : arm.max_angle_rad) configuration.Put(-Finite(angle)).Put(Finite(angle));
  for (const double speed : arm.max_speed_rad_s) configuration.Put(speed).Put(40.0);
  configuration.Put(1.05).Put(1.4).Put(0.25).Put(1.2).Put(0.1);
  configuration.PutAll(arm.a_m).PutAll(arm.d_m).PutAll(arm.alpha_rad).PutAll(arm.theta_rad);
  configuration.Put(int32_t{e_series ? 5 : 3}).Put(int32_t{e_series ? 2 : 1}).Put(int32_t{3}).Put(int32_t{0});

  return Sized(16, Sized(0, mode.bytes) + Sized(1, joints.bytes) + Sized(4, cartesian.bytes) +
                       Sized(5, kinematics.bytes) + Sized(6, configuration.bytes));
}

}  // namespace touchstone::rig
