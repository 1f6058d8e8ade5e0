// The programs of this gateway, as text for the controller. See ../registers.h for what they read and write.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/kinematics/kinematics.h"
#include "server/gateway/arm/protocol/registers.h"

namespace touchstone::gateway::arm {

struct ScriptOptions {
  Eigen::Isometry3d flange_from_tip = Eigen::Isometry3d::Identity();
  double payload_kg = 0.5;
  std::optional<Eigen::Vector3d> payload_cog_m;  // flange frame; none: that of the installation stays
  double transit_speed_m_s = 0.25;
  double acceleration_m_s2 = 1.2;
  double joint_speed_rad_s = 1.05, joint_acceleration_rad_s2 = 1.4;
  double time_scale = 1;                     // rig seconds in one host second
  double watchdog_hz = kWatchdogHz;          // of heartbeats, host time
  Eigen::Vector3d gravity_m_s2{0, 0, 9.82};  // as set_gravity takes it; this one (a table) is not sent
};

// Every program makes its settings, shows its id in phase kNone, and waits at rest for kCommandMove: what the controller
// was sent moves nothing yet.

// "p[0.3,0,0.1,3.14159,0,0]": position in m, rotation vector in rad.
std::string PoseText(const Eigen::Isometry3d& pose);

// `speeds_m_s` has one speed for every line of the transit, and one for the retract.
std::string TouchProgram(const ArmTouch& touch, const std::vector<double>& speeds_m_s,
                         const ScriptOptions& options);
// One speed for every pose, and one of the joint that turns farthest for every set of joints.
std::string MoveProgram(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                        const std::vector<double>& speeds_m_s, const std::vector<Joints>& joints,
                        const std::vector<double>& speeds_rad_s, const ScriptOptions& options);
// Frees the arm until kCommandRetract. An e-Series calls it freedrive_mode, a CB3 teach_mode (UR's script manuals, SW 5
// and SW 3). What ends the program ends it too: a stop, another program, the watchdog.
std::string FreedriveProgram(uint32_t program_id, bool e_series, const ScriptOptions& options);
std::string StopProgram();
inline constexpr char kStopProgramName[] = "stop_motion";

// What stands in the command register to command a program.
int32_t CommandWord(uint32_t program_id, int command);

// How a straight line of the tip is made: as fast as `speed_m_s`, slower where the tool turns much on
// a short way.
double LineSpeed(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s);
// Rig seconds that it takes, from rest to rest.
double LineDuration(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                    double acceleration_m_s2);
inline constexpr double kMaxTurnRadS = 1.5;  // of the tool on a line

}  // namespace touchstone::gateway::arm
