#include "tests/rig/controller/protocol/realtime_packet.h"

#include "tests/rig/controller/network/wire.h"

namespace touchstone::rig {
namespace {

constexpr double kOwnUse = 0;  // "used by Universal Robots software only"

}  // namespace

std::string RealtimePacket(const RobotState& s) {
  const Vector6 none = Vector6::Zero();
  const double joint_mode = s.robot_mode == kRunning ? 253 : s.robot_mode == kIdle ? 255 : 239;
  WireWriter to;
  to.Put(s.timestamp_s);
  to.PutAll(s.target_q).PutAll(s.target_qd).PutAll(s.target_qdd);
  to.PutAll(none).PutAll(none);  // currents and moments
  to.PutAll(s.actual_q).PutAll(s.actual_qd).PutAll(none).PutAll(none);
  to.PutAll(s.actual_tcp_pose).PutAll(s.actual_tcp_speed).PutAll(s.actual_tcp_force);
  to.PutAll(s.target_tcp_pose).PutAll(s.target_tcp_speed);
  to.Put(static_cast<double>(s.digital_inputs));
  to.PutAll(Vector6(Vector6::Constant(28)));  // motors, degrees Celsius
  to.Put(1e-4).Put(kOwnUse);                  // time of the control thread; test value
  to.Put(static_cast<double>(s.robot_mode)).PutAll(Vector6(Vector6::Constant(joint_mode)));
  to.Put(static_cast<double>(s.safety_mode)).PutAll(none);
  to.Put(0.0).Put(0.0).Put(-9.82);  // accelerometer of the tool
  to.PutAll(none);
  to.Put(s.speed_scaling).Put(0.0).Put(kOwnUse).Put(kOwnUse);              // with the norm of linear momentum
  to.Put(48.0).Put(48.0).Put(0.5).PutAll(Vector6(Vector6::Constant(48)));  // main, robot, its current, joints
  to.Put(static_cast<double>(s.digital_outputs)).Put(static_cast<double>(s.runtime_state));
  to.PutAll(s.elbow_m).PutAll(Eigen::Vector3d(0, 0, 0));
  to.Put(static_cast<double>(s.safety_mode)).Put(kOwnUse).Put(kOwnUse).Put(kOwnUse);
  to.Put(s.payload_kg).PutAll(s.payload_cog_m).PutAll(none);
  WireWriter whole;
  whole.Put(static_cast<int32_t>(4 + to.bytes.size())).Text(to.bytes);
  return whole.bytes;
}

}  // namespace touchstone::rig
