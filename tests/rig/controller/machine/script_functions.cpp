// The functions of the controller that scripts may call. Blends (r=) are driven as stops.
#include <cmath>

#include "tests/rig/controller/machine/script_builtin.h"

namespace touchstone::rig {
namespace {

using namespace builtin;  // its helpers

int Register(const Value& value, int count) {
  const int index = value.AsInteger("a register's number");
  if (index < 0 || index >= count)
    throw ScriptError("register " + std::to_string(index) + " does not exist; there are 0 to " +
                      std::to_string(count - 1));
  return index;
}

Eigen::Isometry3d TipTarget(Machine& machine, const Value& target) {
  const Vector6 six = target.AsSix("the target");
  if (target.kind == Value::Kind::kPose) return FromPose(six);
  return BaseFromFlange(machine.geometry(), six) * machine.flange_from_tip();
}

Joints JointTarget(Machine& machine, const Value& target, const Joints& near, const Eigen::Isometry3d& tool) {
  const Vector6 six = target.AsSix("the target");
  if (target.kind == Value::Kind::kList) return six;
  const auto found = AllInverse(machine.geometry(), FromPose(six) * tool.inverse(), near);
  if (found.empty()) throw ScriptError("no joint positions reach the pose " + target.ToText());
  return found.front();
}

double PayloadOf(const Value& value) {
  const double kg = value.AsNumber("a payload");
  if (!(kg >= 0 && kg <= 3)) throw ScriptError("a payload must lie between 0 and 3 kg, is " + value.ToText());
  return kg;
}

Eigen::Vector3d CogOf(const Value& value) {
  if (value.items.size() != 3) throw ScriptError("a centre of gravity has three numbers");
  Eigen::Vector3d cog;
  for (int i = 0; i < 3; ++i) cog[i] = value.items[i].AsNumber("a centre of gravity");
  return cog;
}

double Apply(const Value& value, double (*of)(double)) {
  return of(value.AsNumber("an argument"));
}

const std::vector<BuiltinRow>& MainRows() {
  static const std::vector<BuiltinRow> rows = {
      // Motion.
      {{"movel", {"pose", "a", "v", "t", "r"}, 1},
       [](Machine& m, const Arguments& x, int thread) {
         return m.MoveLine(TipTarget(m, x[0]), NumberOr(x, 2, "v", 0.25), NumberOr(x, 1, "a", 1.2),
                           NumberOr(x, 3, "t", 0), thread);
       }},
      {{"movep", {"pose", "a", "v", "r"}, 1},
       [](Machine& m, const Arguments& x, int thread) {
         return m.MoveLine(TipTarget(m, x[0]), NumberOr(x, 2, "v", 0.25), NumberOr(x, 1, "a", 1.2), 0,
                           thread);
       }},
      {{"movej", {"q", "a", "v", "t", "r"}, 1},
       [](Machine& m, const Arguments& x, int thread) {
         return m.MoveJoints(JointTarget(m, x[0], m.JointsAt(m.now_s()), m.flange_from_tip()),
                             NumberOr(x, 2, "v", 1.05), NumberOr(x, 1, "a", 1.4), NumberOr(x, 3, "t", 0),
                             thread);
       }},
      {{"speedl", {"xd", "a", "t", "aRot", "t_min"}, 1},
       [](Machine& m, const Arguments& x, int thread) {
         return m.MoveAlong(x[0].AsSix("xd"), NumberOr(x, 1, "a", 1.2),
                            NumberOr(x, 2, "t", NumberOr(x, 4, "t_min", 0)), thread);
       }},
      {{"stopl", {"a", "aRot"}, 0},
       [](Machine& m, const Arguments& x, int) { return m.StopMotion(NumberOr(x, 0, "a", 20)); }},
      {{"stopj", {"a"}, 0},
       [](Machine& m, const Arguments& x, int) { return m.StopMotion(NumberOr(x, 0, "a", 20)); }},
      // The tool.
      {{"set_tcp", {"pose", "tcp_name"}, 1},
       [](Machine& m, const Arguments& x, int) {
         m.SetTool(FromPose(x[0].AsSix("the tool's pose")));
         return Outcome{};
       }},
      {{"set_payload", {"m", "cog"}, 1},
       [](Machine& m, const Arguments& x, int) {
         std::optional<Eigen::Vector3d> cog;
         if (Given(x, 1)) cog = CogOf(x[1]);
         m.SetPayload(PayloadOf(x[0]), cog);
         return Outcome{};
       }},
      {{"set_payload_mass", {"m"}, 1},
       [](Machine& m, const Arguments& x, int) {
         m.SetPayloadMass(PayloadOf(x[0]));
         return Outcome{};
       }},
      {{"set_payload_cog", {"CoG"}, 1},
       [](Machine& m, const Arguments& x, int) {
         m.SetPayload(m.payload_kg(), CogOf(x[0]));
         return Outcome{};
       }},
      {{"set_target_payload", {"m", "cog", "inertia", "transition_time"}, 2},
       [](Machine& m, const Arguments& x, int) {
         m.SetPayload(PayloadOf(x[0]), CogOf(x[1]));
         return Outcome{};
       }},
      {{"zero_ftsensor", {}, 0},
       [](Machine& m, const Arguments&, int) {
         m.ZeroForceSensor();
         return Outcome{};
       }},
      {{"set_gravity", {"d"}, 1}, Nothing},
      // A hand may move the arm. The first pair is of the e-Series, the second of both series (script manuals).
      {{"freedrive_mode", {"freeAxes", "feature"}, 0},
       [](Machine& m, const Arguments&, int) {
         if (!m.e_series()) throw ScriptError("freedrive_mode is not known to a CB3; teach_mode is");
         m.SetFreedrive(true);
         return Outcome{};
       }},
      {{"end_freedrive_mode", {}, 0},
       [](Machine& m, const Arguments&, int) {
         if (!m.e_series()) throw ScriptError("end_freedrive_mode is not known to a CB3; end_teach_mode is");
         m.SetFreedrive(false);
         return Outcome{};
       }},
      {{"teach_mode", {}, 0},
       [](Machine& m, const Arguments&, int) {
         m.SetFreedrive(true);
         return Outcome{};
       }},
      {{"end_teach_mode", {}, 0},
       [](Machine& m, const Arguments&, int) {
         m.SetFreedrive(false);
         return Outcome{};
       }},
      // What the arm does.
      {{"get_actual_tcp_pose", {}, 0},
       [](Machine& m, const Arguments&, int) {
         return Result(Value::Vector(m.State().actual_tcp_pose, Value::Kind::kPose));
       }},
      {{"get_target_tcp_pose", {}, 0},
       [](Machine& m, const Arguments&, int) { return Pose(m.FlangeAt(m.now_s()) * m.flange_from_tip()); }},
      {{"get_actual_joint_positions", {}, 0},
       [](Machine& m, const Arguments&, int) {
         return Result(Value::Vector(m.State().actual_q, Value::Kind::kList));
       }},
      {{"get_target_joint_positions", {}, 0},
       [](Machine& m, const Arguments&, int) {
         return Result(Value::Vector(m.JointsAt(m.now_s()), Value::Kind::kList));
       }},
      {{"get_target_tcp_speed", {}, 0},
       [](Machine& m, const Arguments&, int) {
         return Result(Value::Vector(m.State().target_tcp_speed, Value::Kind::kList));
       }},
      {{"get_actual_tcp_speed", {}, 0},
       [](Machine& m, const Arguments&, int) {
         return Result(Value::Vector(m.State().actual_tcp_speed, Value::Kind::kList));
       }},
      {{"is_steady", {}, 0},
       [](Machine& m, const Arguments&, int) { return Result(Value::Bool(m.Resting())); }},
      {{"get_inverse_kin", {"x", "qnear", "maxPositionError", "maxOrientationError", "tcp"}, 1},
       [](Machine& m, const Arguments& x, int) {
         const Joints near = Given(x, 1) ? Joints(x[1].AsSix("qnear")) : m.JointsAt(m.now_s());
         Value pose = x[0];
         pose.kind = Value::Kind::kPose;
         const Eigen::Isometry3d tool = Given(x, 4) ? FromPose(x[4].AsSix("tcp")) : m.flange_from_tip();
         return Result(Value::Vector(JointTarget(m, pose, near, tool), Value::Kind::kList));
       }},
      {{"get_forward_kin", {"q", "tcp"}, 0},
       [](Machine& m, const Arguments& x, int) {
         const Joints q = Given(x, 0) ? Joints(x[0].AsSix("q")) : m.JointsAt(m.now_s());
         const Eigen::Isometry3d tool = Given(x, 1) ? FromPose(x[1].AsSix("tcp")) : m.flange_from_tip();
         return Pose(BaseFromFlange(m.geometry(), q) * tool);
       }},
      // Time.
      {{"sleep", {"t"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Outcome{
             Outcome::Wait::kUntil, {}, m.now_s() + std::max(x[0].AsNumber("a time"), m.cycle_s())};
       }},
      {{"sync", {}, 0},
       [](Machine&, const Arguments&, int) {
         return Outcome{Outcome::Wait::kCycle, {}, 0};
       }},
      {{"get_steptime", {}, 0}, [](Machine& m, const Arguments&, int) { return Number(m.cycle_s()); }},
      // Messages.
      {{"textmsg", {"s1", "s2"}, 1},
       [](Machine& m, const Arguments& x, int) {
         m.Announce({Announcement::kText, "", x[0].ToText() + (Given(x, 1) ? x[1].ToText() : "")});
         return Outcome{};
       }},
      {{"popup", {"s", "title", "warning", "error", "blocking"}, 1},
       [](Machine& m, const Arguments& x, int) {
         m.Announce({Announcement::kPopup, Given(x, 1) ? x[1].ToText() : "Popup", x[0].ToText(),
                     Given(x, 2) && x[2].AsBool("warning"), Given(x, 3) && x[3].AsBool("error")});
         return Outcome{};
       }},
      // Registers.
      {{"read_input_integer_register", {"address"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Number(m.registers().input_int[Register(x[0], 48)]);
       }},
      {{"read_input_float_register", {"address"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Number(m.registers().input_double[Register(x[0], 48)]);
       }},
      {{"read_input_boolean_register", {"address"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Result(Value::Bool(m.registers().input_bit[Register(x[0], 128)]));
       }},
      {{"read_output_integer_register", {"address"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Number(m.registers().output_int[Register(x[0], 48)]);
       }},
      {{"read_output_float_register", {"address"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Number(m.registers().output_double[Register(x[0], 48)]);
       }},
      {{"read_output_boolean_register", {"address"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Result(Value::Bool(m.registers().output_bit[Register(x[0], 128)]));
       }},
      {{"write_output_integer_register", {"address", "value"}, 2},
       [](Machine& m, const Arguments& x, int) {
         m.WriteOutput(Register(x[0], 48),
                       static_cast<int32_t>(x[1].AsInteger("an integer register's value")));
         return Outcome{};
       }},
      {{"write_output_float_register", {"address", "value"}, 2},
       [](Machine& m, const Arguments& x, int) {
         m.WriteOutput(Register(x[0], 48), x[1].AsNumber("a float register's value"));
         return Outcome{};
       }},
      {{"write_output_boolean_register", {"address", "value"}, 2},
       [](Machine& m, const Arguments& x, int) {
         m.WriteOutput(Register(x[0], 128), x[1].AsBool("a boolean register's value"));
         return Outcome{};
       }},
      {{"get_standard_digital_in", {"n"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Result(Value::Bool(m.digital_inputs() >> Register(x[0], 8) & 1));
       }},
      {{"get_standard_digital_out", {"n"}, 1},
       [](Machine& m, const Arguments& x, int) {
         return Result(Value::Bool(m.digital_outputs() >> Register(x[0], 8) & 1));
       }},
      {{"set_standard_digital_out", {"n", "b"}, 2},
       [](Machine& m, const Arguments& x, int) {
         m.SetDigitalOutput(Register(x[0], 8), x[1].AsBool("an output"));
         return Outcome{};
       }},
      {{"set_digital_out", {"n", "b"}, 2},
       [](Machine& m, const Arguments& x, int) {
         m.SetDigitalOutput(Register(x[0], 8), x[1].AsBool("an output"));
         return Outcome{};
       }},
      {{"set_analog_out", {"n", "f"}, 2}, Nothing},
      {{"set_tool_voltage", {"voltage"}, 1}, Nothing},
      {{"rtde_set_watchdog", {"variable_name", "min_frequency", "action"}, 2},
       [](Machine& m, const Arguments& x, int) {
         const std::string action = Given(x, 2) ? x[2].AsString("a watchdog's action") : "pause";
         if (action != "pause" && action != "stop" && action != "ignore")
           throw ScriptError("a watchdog's action is \"pause\", \"stop\" or \"ignore\", not \"" + action +
                             "\"");
         m.SetWatchdog(x[0].AsString("a watchdog's variable"), x[1].AsNumber("a watchdog's frequency"),
                       action);
         return Outcome{};
       }},
      // Calculation.
      {{"pose_trans", {"p_from", "p_from_to"}, 2},
       [](Machine&, const Arguments& x, int) {
         return Pose(FromPose(x[0].AsSix("a pose")) * FromPose(x[1].AsSix("a pose")));
       }},
      {{"pose_inv", {"p_from"}, 1},
       [](Machine&, const Arguments& x, int) { return Pose(FromPose(x[0].AsSix("a pose")).inverse()); }},
      {{"norm", {"a"}, 1},
       [](Machine&, const Arguments& x, int) {
         if (x[0].kind == Value::Kind::kNumber) return Number(std::abs(x[0].number));
         double sum = 0;
         for (const Value& item : x[0].items) sum += std::pow(item.AsNumber("an item"), 2);
         return Number(std::sqrt(sum));
       }},
      {{"length", {"v"}, 1},
       [](Machine&, const Arguments& x, int) { return Number(static_cast<double>(x[0].items.size())); }},
      {{"d2r", {"d"}, 1},
       [](Machine&, const Arguments& x, int) {
         return Number(x[0].AsNumber("an angle") * 3.14159265358979323846 / 180);
       }},
      {{"r2d", {"r"}, 1},
       [](Machine&, const Arguments& x, int) {
         return Number(x[0].AsNumber("an angle") * 180 / 3.14159265358979323846);
       }},
      {{"sqrt", {"f"}, 1},
       [](Machine&, const Arguments& x, int) {
         const double number = x[0].AsNumber("an argument");
         if (number < 0) throw ScriptError("the square root of a number below 0");
         return Number(std::sqrt(number));
       }},
      {{"abs", {"f"}, 1}, [](Machine&, const Arguments& x, int) { return Number(Apply(x[0], std::fabs)); }},
      {{"sin", {"f"}, 1}, [](Machine&, const Arguments& x, int) { return Number(Apply(x[0], std::sin)); }},
      {{"cos", {"f"}, 1}, [](Machine&, const Arguments& x, int) { return Number(Apply(x[0], std::cos)); }},
      {{"floor", {"f"}, 1},
       [](Machine&, const Arguments& x, int) { return Number(Apply(x[0], std::floor)); }},
      {{"ceil", {"f"}, 1}, [](Machine&, const Arguments& x, int) { return Number(Apply(x[0], std::ceil)); }},
  };
  return rows;
}

const std::vector<BuiltinRow>& Rows() {
  static const std::vector<BuiltinRow> rows = [] {
    std::vector<BuiltinRow> all = MainRows();
    const std::vector<BuiltinRow> more = OtherBuiltins();
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }();
  return rows;
}

}  // namespace

const std::vector<BuiltinSignature>& Builtins() {
  static const std::vector<BuiltinSignature> signatures = [] {
    std::vector<BuiltinSignature> all;
    for (const BuiltinRow& row : Rows()) all.push_back(row.signature);
    return all;
  }();
  return signatures;
}

Outcome Machine::CallBuiltin(int index, const std::vector<Value>& arguments, int thread) {
  return Rows()[index].function(*this, arguments, thread);
}

}  // namespace touchstone::rig
