#include "server/gateway/arm/motion/ur_script.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/gateway/arm/motion/line_turn.h"
#include "server/gateway/arm/protocol/registers.h"
#include "server/geometry/pose.h"

namespace touchstone::gateway::arm {
namespace {

std::string Number(double value) {
  return absl::StrFormat("%.9g", value);
}

std::string MoveLine(const Eigen::Isometry3d& to, double acceleration_m_s2, double speed_m_s) {
  return absl::StrCat("movel(", PoseText(to), ", a=", Number(acceleration_m_s2), ", v=", Number(speed_m_s),
                      ")\n");
}

std::string Phase(MotionPhase phase) {
  return absl::StrCat("  write_output_integer_register(", kPhaseRegister, ", ", static_cast<int>(phase),
                      ")\n");
}

// set_payload and set_payload_mass are deprecated from SW 5.10 in favour of set_target_payload, which with its defaults
// does the same (script manual SW 10.6); they are what every controller here knows. Each of them zeroes an e-Series'
// force sensor (the same page): whoever watches the force looks again before the program moves.
//
// UR's script manual (SW 5.x, set_payload): without a centre of gravity the tool centre point is taken for it, which
// for fingers is much too far out; an arm that believes that stops protectively. set_payload_mass leaves the centre of
// gravity as it is, which at the start of a program is the installation's.
std::string Payload(const ScriptOptions& options) {
  const std::string kg = Number(options.payload_kg);
  if (!options.payload_cog_m.has_value()) return absl::StrCat("  set_payload_mass(", kg, ")\n");
  const Eigen::Vector3d& cog = *options.payload_cog_m;
  return absl::StrCat("  set_payload(", kg, ", [", Number(cog.x()), ",", Number(cog.y()), ",",
                      Number(cog.z()), "])\n");
}

std::string WaitFor(uint32_t program_id, int command) {
  return absl::StrCat("  while read_input_integer_register(", kCommandRegister,
                      ") != ", CommandWord(program_id, command), ":\n    sync()\n  end\n");
}

// What every program begins with. The phase is written before the id, so that nobody sees this id with
// an old phase.
std::string Head(uint32_t program_id, const ScriptOptions& options) {
  std::string text = absl::StrCat("  rtde_set_watchdog(\"input_int_register_", kHeartbeatRegister, "\", ",
                                  Number(options.watchdog_hz / options.time_scale), ", \"stop\")\n");
  absl::StrAppend(&text, "  set_tcp(", PoseText(options.flange_from_tip), ")\n", Payload(options));
  if (!options.gravity_m_s2.isApprox(ScriptOptions().gravity_m_s2))
    absl::StrAppend(&text, "  set_gravity([", Number(options.gravity_m_s2.x()), ",",
                    Number(options.gravity_m_s2.y()), ",", Number(options.gravity_m_s2.z()), "])\n");
  absl::StrAppend(&text, Phase(MotionPhase::kNone), "  write_output_integer_register(", kProgramRegister,
                  ", ", program_id, ")\n", WaitFor(program_id, kCommandMove), Phase(MotionPhase::kTransit));
  return text;
}

std::string Lines(const std::vector<Eigen::Isometry3d>& poses, const std::vector<double>& speeds_m_s,
                  const ScriptOptions& options) {
  std::string text;
  for (size_t i = 0; i < poses.size(); ++i)
    absl::StrAppend(&text, "  ", MoveLine(poses[i], options.acceleration_m_s2, speeds_m_s[i]));
  return text;
}

}  // namespace

std::string PoseText(const Eigen::Isometry3d& pose) {
  std::string text = "p[";
  for (const double value : geometry::PoseVectorOf(pose))
    absl::StrAppend(&text, text.size() > 2 ? "," : "", Number(value));
  return text + "]";
}

int32_t CommandWord(uint32_t program_id, int command) {
  return static_cast<int32_t>(4 * (program_id % (1u << 28))) + command;
}

double LineSpeed(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s) {
  const double distance_m = (to.translation() - from.translation()).norm(), turn_rad = TurnRad(from, to);
  if (distance_m < 1e-4 || turn_rad <= 0) return speed_m_s;  // the tool turns on the spot
  return std::min(speed_m_s, distance_m * kMaxTurnRadS / turn_rad);
}

double LineDuration(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                    double acceleration_m_s2) {
  const double distance_m = (to.translation() - from.translation()).norm(),
               v = LineSpeed(from, to, speed_m_s);
  const double ramp_m = v * v / acceleration_m_s2;  // of both ends
  const double straight_s = distance_m < ramp_m ? 2 * std::sqrt(distance_m / acceleration_m_s2)
                                                : distance_m / v + v / acceleration_m_s2;
  return std::max(straight_s, TurnRad(from, to) / kMaxTurnRadS);
}

std::string TouchProgram(const ArmTouch& touch, const std::vector<double>& speeds_m_s,
                         const ScriptOptions& options) {
  const Eigen::Isometry3d& start = touch.transit.back();
  const std::string command = absl::StrCat("read_input_integer_register(", kCommandRegister, ")");
  const std::string acceleration = Number(options.acceleration_m_s2);
  std::string text = absl::StrCat("def touch_", touch.program_id, "():\n", Head(touch.program_id, options));
  absl::StrAppend(&text, Lines(touch.transit, speeds_m_s, options), Phase(MotionPhase::kReady));

  // Waits for the command; the approach runs in a thread, so that the end can be commanded at any
  // moment of it.
  absl::StrAppend(&text, WaitFor(touch.program_id, kCommandGo));
  absl::StrAppend(&text, "  global approaching = True\n  thread approach():\n    ",
                  MoveLine(touch.end, options.acceleration_m_s2, touch.speed_m_s),
                  "    approaching = False\n  end\n", Phase(MotionPhase::kApproach),
                  "  handle = run approach()\n");
  absl::StrAppend(&text, "  while approaching and ", command,
                  " != ", CommandWord(touch.program_id, kCommandRetract),
                  ":\n    sync()\n  end\n  kill handle\n  stopl(", acceleration, ")\n");
  absl::StrAppend(&text, Phase(MotionPhase::kRetract), "  ",
                  MoveLine(start, options.acceleration_m_s2, speeds_m_s.back()), Phase(MotionPhase::kDone),
                  "end\n");
  return text;
}

std::string MoveProgram(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                        const std::vector<double>& speeds_m_s, const std::vector<Joints>& joints,
                        const std::vector<double>& speeds_rad_s, const ScriptOptions& options) {
  std::string text = absl::StrCat("def move_", program_id, "():\n", Head(program_id, options),
                                  Lines(poses, speeds_m_s, options));
  for (size_t k = 0; k < joints.size(); ++k) {
    absl::StrAppend(&text, "  movej([");
    for (size_t i = 0; i < joints[k].size(); ++i)
      absl::StrAppend(&text, i == 0 ? "" : ",", Number(joints[k][i]));
    absl::StrAppend(&text, "], a=", Number(options.joint_acceleration_rad_s2),
                    ", v=", Number(speeds_rad_s[k]), ")\n");
  }
  return absl::StrCat(text, Phase(MotionPhase::kDone), "end\n");
}

std::string FreedriveProgram(uint32_t program_id, bool e_series, const ScriptOptions& options) {
  const std::string mode = e_series ? "freedrive_mode()\n" : "teach_mode()\n";
  return absl::StrCat("def guide_", program_id, "():\n", Head(program_id, options), "  ", mode,
                      Phase(MotionPhase::kReady), WaitFor(program_id, kCommandRetract), "  end_", mode,
                      Phase(MotionPhase::kDone), "end\n");
}

std::string StopProgram() {
  return absl::StrCat("def ", kStopProgramName, "():\n  stopl(10)\nend\n");
}

}  // namespace touchstone::gateway::arm
