#include "server/session/recorded/base_pose.h"

#include <cmath>

#include "server/base/numbers/nan.h"

namespace touchstone::session {
namespace {

void Write(const double* xyz, v1::Vector3* message) {
  message->set_x(xyz[0]);
  message->set_y(xyz[1]);
  message->set_z(xyz[2]);
}

}  // namespace

v1::BasePose BasePoseMessage(const std::array<double, 6>& pose) {
  v1::BasePose message;
  if (std::isnan(pose[0])) return message;
  Write(pose.data(), message.mutable_position_m());
  Write(pose.data() + 3, message.mutable_rotation_rad());
  return message;
}

std::array<double, 6> ParseBasePose(const v1::BasePose& message) {
  if (!message.has_position_m()) return {kNaN, kNaN, kNaN, kNaN, kNaN, kNaN};
  const v1::Vector3 &p = message.position_m(), &r = message.rotation_rad();
  return {p.x(), p.y(), p.z(), r.x(), r.y(), r.z()};
}

}  // namespace touchstone::session
