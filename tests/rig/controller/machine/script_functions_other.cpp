// Functions that other people's programs name. What is not emulated compiles, as on a controller, and ends the program
// with an exception where it is called: ur_rtde's control program names 18 of them and calls few.
#include <string>

#include "tests/rig/controller/machine/script_builtin.h"

namespace touchstone::rig {
namespace {

using namespace builtin;

template <const char* kName>
Outcome NotEmulated(Machine&, const Arguments&, int) {
  throw ScriptError(std::string(kName) + " is not emulated");
}

bool Reaches(const Machine& machine, const Value& target) {
  const Vector6 six = target.AsSix("the target");
  const Joints near = machine.JointsAt(machine.now_s());
  if (target.kind == Value::Kind::kList) {
    for (int i = 0; i < 6; ++i)
      if (std::abs(six[i]) > machine.geometry().max_angle_rad[i]) return false;
    return true;
  }
  return !AllInverse(machine.geometry(), FromPose(six) * machine.flange_from_tip().inverse(), near).empty();
}

constexpr char kForceMode[] = "force_mode", kServoj[] = "servoj", kServoc[] = "servoc", kSpeedj[] = "speedj",
               kToolContact[] = "tool_contact", kHistory[] = "get_actual_joint_positions_history",
               kWaypoint[] = "get_target_waypoint", kExternalSensor[] = "enable_external_ft_sensor",
               kRtdeSensor[] = "ft_rtde_input_enable";

}  // namespace

std::vector<BuiltinRow> OtherBuiltins() {
  return {
      {{"get_tcp_offset", {}, 0},
       [](Machine& m, const Arguments&, int) { return Pose(m.flange_from_tip()); }},
      {{"get_actual_tool_flange_pose", {}, 0},
       [](Machine& m, const Arguments&, int) { return Pose(m.ActualFlangeAt(m.now_s())); }},
      {{"pose_sub", {"p_to", "p_from"}, 2},
       [](Machine&, const Arguments& x, int) {
         const Eigen::Isometry3d to = FromPose(x[0].AsSix("a pose")), from = FromPose(x[1].AsSix("a pose"));
         Eigen::Isometry3d difference = Eigen::Isometry3d::Identity();
         difference.translation() = to.translation() - from.translation();
         difference.linear() = to.linear() * from.linear().transpose();
         return Pose(difference);
       }},
      {{"is_within_safety_limits", {"pose", "qnear"}, 1},
       [](Machine& m, const Arguments& x, int) { return Result(Value::Bool(Reaches(m, x[0]))); }},
      {{"get_inverse_kin_has_solution", {"x", "qnear", "maxPositionError", "maxOrientationError", "tcp"}, 1},
       [](Machine& m, const Arguments& x, int) { return Result(Value::Bool(Reaches(m, x[0]))); }},
      {{"get_joint_torques", {}, 0},
       [](Machine&, const Arguments&, int) {
         return Result(Value::Vector(Vector6(Vector6::Zero()), Value::Kind::kList));
       }},
      {{"get_target_payload", {}, 0},
       [](Machine& m, const Arguments&, int) { return Number(m.payload_kg()); }},
      {{"get_target_payload_cog", {}, 0},
       [](Machine& m, const Arguments&, int) {
         const Eigen::Vector3d cog_m = m.PayloadCog();
         return Result(
             Value::List({Value::Number(cog_m.x()), Value::Number(cog_m.y()), Value::Number(cog_m.z())}));
       }},
      {{"get_target_payload_inertia", {}, 0},
       [](Machine&, const Arguments&, int) {
         return Result(Value::Vector(Vector6(Vector6::Zero()), Value::Kind::kList));
       }},
      {{"get_target_joint_accelerations", {}, 0},
       [](Machine& m, const Arguments&, int) {
         return Result(Value::Vector(m.State().target_qdd, Value::Kind::kList));
       }},
      {{"get_freedrive_status", {}, 0},
       [](Machine& m, const Arguments&, int) { return Number(m.free() ? 1 : 0); }},
      {{"protective_stop", {}, 0},
       [](Machine& m, const Arguments&, int) {
         m.RequestProtectiveStop();
         return Outcome{Outcome::Wait::kCycle, {}, 0};
       }},
      {{"end_force_mode", {}, 0}, Nothing},
      {{"force_mode_set_damping", {"damping"}, 1}, Nothing},
      {{"force_mode_set_gain_scaling", {"scaling"}, 1}, Nothing},
      {{kForceMode, {"task_frame", "selection_vector", "wrench", "type", "limits"}, 5},
       NotEmulated<kForceMode>},
      {{kServoj, {"q", "a", "v", "t", "lookahead_time", "gain"}, 1}, NotEmulated<kServoj>},
      {{kServoc, {"pose", "a", "v", "r"}, 1}, NotEmulated<kServoc>},
      {{kSpeedj, {"qd", "a", "t"}, 1}, NotEmulated<kSpeedj>},
      {{kToolContact, {"direction"}, 0}, NotEmulated<kToolContact>},
      {{kHistory, {"steps"}, 0}, NotEmulated<kHistory>},
      {{kWaypoint, {}, 0}, NotEmulated<kWaypoint>},
      {{kExternalSensor, {"enable", "sensor_mass", "sensor_measuring_offset", "sensor_cog"}, 1},
       NotEmulated<kExternalSensor>},
      {{kRtdeSensor, {"enable", "sensor_mass", "sensor_measuring_offset", "sensor_cog"}, 1},
       NotEmulated<kRtdeSensor>},
  };
}

}  // namespace touchstone::rig
