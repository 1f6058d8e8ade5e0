#include "tests/rig/controller/protocol/rtde_fields.h"

#include <cmath>

namespace touchstone::rig {
namespace {

using Outputs = std::map<std::string, RtdeOutput>;
using Inputs = std::map<std::string, RtdeInput>;

template <typename Get>
RtdeOutput Scalar(const char* type, Get get) {
  return {type, [get](const RobotState& state, WireWriter* to) { to->Put(get(state)); }};
}
template <typename Get>
RtdeOutput Vector(const char* type, Get get) {
  return {type, [get](const RobotState& state, WireWriter* to) { to->PutAll(get(state)); }};
}
RtdeOutput Constant(double value) {
  return Scalar("DOUBLE", [value](const RobotState&) { return value; });
}
RtdeOutput Constant6(double value) {
  return Vector("VECTOR6D", [value](const RobotState&) { return Vector6(Vector6::Constant(value)); });
}
RtdeOutput ConstantWord(uint32_t value) {
  return Scalar("UINT32", [value](const RobotState&) { return value; });
}

// Not on CB3.
RtdeOutput ESeries(RtdeOutput output) {
  output.e_series_only = true;
  return output;
}

uint32_t Packed(const std::array<bool, 128>& bits, int from) {
  uint32_t word = 0;
  for (int i = 0; i < 32; ++i) word |= static_cast<uint32_t>(bits[from + i]) << i;
  return word;
}

void AddMotion(Outputs& all) {
  all["target_q"] = Vector("VECTOR6D", [](const RobotState& s) { return s.target_q; });
  all["target_qd"] = Vector("VECTOR6D", [](const RobotState& s) { return s.target_qd; });
  all["target_qdd"] = Vector("VECTOR6D", [](const RobotState& s) { return s.target_qdd; });
  all["actual_q"] = Vector("VECTOR6D", [](const RobotState& s) { return s.actual_q; });
  all["actual_qd"] = Vector("VECTOR6D", [](const RobotState& s) { return s.actual_qd; });
  all["actual_TCP_pose"] = Vector("VECTOR6D", [](const RobotState& s) { return s.actual_tcp_pose; });
  all["actual_TCP_speed"] = Vector("VECTOR6D", [](const RobotState& s) { return s.actual_tcp_speed; });
  all["actual_TCP_force"] = Vector("VECTOR6D", [](const RobotState& s) { return s.actual_tcp_force; });
  all["ft_raw_wrench"] = ESeries(all["actual_TCP_force"]);  // 5.9
  all["target_TCP_pose"] = Vector("VECTOR6D", [](const RobotState& s) { return s.target_tcp_pose; });
  all["target_TCP_speed"] = Vector("VECTOR6D", [](const RobotState& s) { return s.target_tcp_speed; });
  all["tcp_offset"] = Vector("VECTOR6D", [](const RobotState& s) { return s.tcp_offset; });
  all["elbow_position"] = Vector("VECTOR3D", [](const RobotState& s) { return s.elbow_m; });
  all["elbow_velocity"] = Vector("VECTOR3D", [](const RobotState&) { return Eigen::Vector3d(0, 0, 0); });
  all["tcp_force_scalar"] =
      Scalar("DOUBLE", [](const RobotState& s) { return s.actual_tcp_force.head<3>().norm(); });
  all["actual_tool_accelerometer"] =
      Vector("VECTOR3D", [](const RobotState&) { return Eigen::Vector3d(0, 0, -9.82); });
  all["actual_momentum"] = Constant(0);
  for (const char* name : {"target_current", "actual_current", "joint_control_output", "target_moment"})
    all[name] = Constant6(0);
  all["joint_temperatures"] = Constant6(28);
  all["actual_joint_voltage"] = Constant6(48);
}

void AddModes(Outputs& all) {
  all["timestamp"] = Scalar("DOUBLE", [](const RobotState& s) { return s.timestamp_s; });
  all["actual_execution_time"] = Constant(0.1);
  all["robot_mode"] = Scalar("INT32", [](const RobotState& s) { return s.robot_mode; });
  all["safety_mode"] = Scalar("INT32", [](const RobotState& s) { return s.safety_mode; });
  all["safety_status"] = Scalar("INT32", [](const RobotState& s) { return s.safety_mode; });
  all["joint_mode"] = Vector("VECTOR6INT32", [](const RobotState& s) {
    std::array<int32_t, 6> modes;
    modes.fill(s.robot_mode == kRunning ? 253 : s.robot_mode == kIdle ? 255 : 239);
    return modes;
  });
  all["runtime_state"] =
      Scalar("UINT32", [](const RobotState& s) { return static_cast<uint32_t>(s.runtime_state); });
  all["robot_status_bits"] = Scalar("UINT32", [](const RobotState& s) { return s.robot_status_bits; });
  all["safety_status_bits"] = Scalar("UINT32", [](const RobotState& s) { return s.safety_status_bits; });
  all["speed_scaling"] = Scalar("DOUBLE", [](const RobotState& s) { return s.speed_scaling; });
  all["target_speed_fraction"] =
      Scalar("DOUBLE", [](const RobotState& s) { return s.target_speed_fraction; });
  all["script_control_line"] =
      Scalar("UINT32", [](const RobotState& s) { return static_cast<uint32_t>(s.script_line); });
  all["payload"] = Scalar("DOUBLE", [](const RobotState& s) { return s.payload_kg; });
  all["payload_cog"] = Vector("VECTOR3D", [](const RobotState& s) { return s.payload_cog_m; });
  all["payload_inertia"] = Constant6(0);
}

void AddElectrics(Outputs& all) {
  all["actual_digital_input_bits"] = Scalar("UINT64", [](const RobotState& s) { return s.digital_inputs; });
  all["actual_digital_output_bits"] = Scalar("UINT64", [](const RobotState& s) { return s.digital_outputs; });
  all["actual_main_voltage"] = Constant(48);
  all["actual_robot_voltage"] = Constant(48);
  all["actual_robot_current"] = Constant(0.5);
  all["io_current"] = Constant(0.02);
  for (const char* name : {"standard_analog_input0", "standard_analog_input1", "standard_analog_output0",
                           "standard_analog_output1", "tool_analog_input0", "tool_analog_input1",
                           "tool_output_current", "euromap67_24V_voltage", "euromap67_24V_current"})
    all[name] = Constant(0);
  all["tool_temperature"] = Constant(28);
  all["tool_output_voltage"] = Scalar("INT32", [](const RobotState&) { return int32_t{0}; });
  for (const char* name :
       {"tool_output_mode", "tool_digital_output0_mode", "tool_digital_output1_mode"})  // 5.2
    all[name] = ESeries(Scalar("UINT8", [](const RobotState&) { return uint8_t{0}; }));
  for (const char* name : {"analog_io_types", "tool_mode", "tool_analog_input_types", "euromap67_input_bits",
                           "euromap67_output_bits"})
    all[name] = ConstantWord(0);
}

void AddRegisters(Outputs& all) {
  for (int i = 0; i < 48; ++i) {
    const std::string n = std::to_string(i);
    all["output_int_register_" + n] =
        Scalar("INT32", [i](const RobotState& s) { return s.registers.output_int[i]; });
    all["input_int_register_" + n] =
        Scalar("INT32", [i](const RobotState& s) { return s.registers.input_int[i]; });
    all["output_double_register_" + n] =
        Scalar("DOUBLE", [i](const RobotState& s) { return s.registers.output_double[i]; });
    all["input_double_register_" + n] =
        Scalar("DOUBLE", [i](const RobotState& s) { return s.registers.input_double[i]; });
  }
  for (int i = 64; i < 128; ++i) {
    const std::string n = std::to_string(i);
    all["output_bit_register_" + n] =
        Scalar("BOOL", [i](const RobotState& s) { return static_cast<uint8_t>(s.registers.output_bit[i]); });
    all["input_bit_register_" + n] =
        Scalar("BOOL", [i](const RobotState& s) { return static_cast<uint8_t>(s.registers.input_bit[i]); });
  }
  for (const int from : {0, 32}) {
    const std::string n = from == 0 ? "0_to_31" : "32_to_63";
    all["output_bit_registers" + n] =
        Scalar("UINT32", [from](const RobotState& s) { return Packed(s.registers.output_bit, from); });
    all["input_bit_registers" + n] =
        Scalar("UINT32", [from](const RobotState& s) { return Packed(s.registers.input_bit, from); });
  }
}

// What a client writes beside the registers. A mask and its value come in one message, the mask first or
// last: the outputs are set with the value, under the last mask.
void AddControls(Inputs& all) {
  const auto ignore = [&](const char* name, const char* type, size_t bytes) {
    all[name] = {type, bytes, [bytes](Machine*, WireReader* from) {
                   for (size_t i = 0; i < bytes; ++i) from->Get<uint8_t>();
                 }};
  };
  all["speed_slider_mask"] = {"UINT32", 4,
                              [](Machine* m, WireReader* from) { m->slider_mask = from->Get<uint32_t>(); }};
  all["speed_slider_fraction"] = {"DOUBLE", 8, [](Machine* m, WireReader* from) {
                                    const double fraction = from->Get<double>();
                                    if (m->slider_mask != 0 && std::isfinite(fraction))
                                      m->SetSpeedSlider(fraction);
                                  }};
  all["standard_digital_output_mask"] = {
      "UINT8", 1, [](Machine* m, WireReader* from) { m->digital_output_mask = from->Get<uint8_t>(); }};
  all["standard_digital_output"] = {"UINT8", 1, [](Machine* m, WireReader* from) {
                                      m->SetDigitalOutputs(m->digital_output_mask, from->Get<uint8_t>());
                                    }};
  for (const char* name :
       {"configurable_digital_output_mask", "configurable_digital_output", "tool_digital_output_mask",
        "tool_digital_output", "standard_analog_output_mask", "standard_analog_output_type"})
    ignore(name, "UINT8", 1);
  for (const char* name : {"standard_analog_output_0", "standard_analog_output_1"}) ignore(name, "DOUBLE", 8);
  ignore("external_force_torque", "VECTOR6D", 48);
}

}  // namespace

const Outputs& RtdeOutputs() {
  static const Outputs outputs = [] {
    Outputs all;
    AddMotion(all);
    AddModes(all);
    AddElectrics(all);
    AddRegisters(all);
    return all;
  }();
  return outputs;
}

const Inputs& RtdeInputs() {
  static const Inputs inputs = [] {
    Inputs all;
    AddControls(all);
    for (int i = 0; i < 48; ++i) {
      const std::string n = std::to_string(i);
      all["input_int_register_" + n] = {"INT32", 4, [i](Machine* m, WireReader* from) {
                                          m->registers().input_int[i] = from->Get<int32_t>();
                                        }};
      all["input_double_register_" + n] = {"DOUBLE", 8, [i](Machine* m, WireReader* from) {
                                             m->registers().input_double[i] = from->Get<double>();
                                           }};
    }
    for (int i = 64; i < 128; ++i)
      all["input_bit_register_" + std::to_string(i)] = {
          "BOOL", 1,
          [i](Machine* m, WireReader* from) { m->registers().input_bit[i] = from->Get<uint8_t>() != 0; }};
    for (const int from_bit : {0, 32})
      all[from_bit == 0 ? "input_bit_registers0_to_31" : "input_bit_registers32_to_63"] = {
          "UINT32", 4, [from_bit](Machine* m, WireReader* from) {
            const uint32_t word = from->Get<uint32_t>();
            for (int i = 0; i < 32; ++i) m->registers().input_bit[from_bit + i] = word >> i & 1;
          }};
    return all;
  }();
  return inputs;
}

}  // namespace touchstone::rig
