#include "server/session/journal/command_bytes.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cmath>

namespace touchstone::session {
namespace {

bool Near(double a, double b) {
  return std::abs(a - b) <= kCommandTolerance;
}

// Fields of a later version, or bytes that only happen to parse.
std::string UnknownBytes(v1::CommandedTouch command) {
  command.clear_target_m(), command.clear_approach(), command.clear_lateral();
  command.clear_standoff_m(), command.clear_speed_m_s(), command.clear_stroke_m();
  command.clear_session_time_s(), command.clear_covariates();
  return CommandBytes(command);
}

bool Near(const v1::Vector3& a, const v1::Vector3& b) {
  return Near(a.x(), b.x()) && Near(a.y(), b.y()) && Near(a.z(), b.z());
}

}  // namespace

std::string CommandBytes(const v1::CommandedTouch& command) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    command.SerializeToCodedStream(&coded);
  }
  return bytes;
}

std::optional<v1::CommandedTouch> ParseCommandBytes(const std::string& bytes) {
  v1::CommandedTouch command;
  if (!command.ParseFromString(bytes)) return std::nullopt;
  return command;
}

v1::CommandedTouch CommandMessage(const touch::CommandedTouch& touch) {
  v1::CommandedTouch message;
  const auto set = [](const Eigen::Vector3d& from, v1::Vector3* to) {
    to->set_x(from.x()), to->set_y(from.y()), to->set_z(from.z());
  };
  set(touch.target_m, message.mutable_target_m());
  set(touch.approach, message.mutable_approach());
  set(touch.lateral, message.mutable_lateral());
  message.set_standoff_m(touch.standoff_m);
  message.set_speed_m_s(touch.speed_m_s);
  if (touch.stroke_m < touch::kNoStrokeLimitM) message.set_stroke_m(touch.stroke_m);
  message.set_session_time_s(touch.session_time_s);
  message.mutable_covariates()->insert(touch.covariates.begin(), touch.covariates.end());
  return message;
}

std::string CommandBytes(const touch::CommandedTouch& touch) {
  v1::CommandedTouch command = CommandMessage(touch);
  command.clear_session_time_s();
  return CommandBytes(command);
}

bool SamePath(const v1::CommandedTouch& a, const v1::CommandedTouch& b) {
  return Near(a.target_m(), b.target_m()) && Near(a.approach(), b.approach()) &&
         Near(a.lateral(), b.lateral()) && Near(a.standoff_m(), b.standoff_m()) &&
         Near(a.speed_m_s(), b.speed_m_s()) && a.has_stroke_m() == b.has_stroke_m() &&
         Near(a.stroke_m(), b.stroke_m());
}

bool SameCommand(const std::string& a, const std::string& b) {
  if (a == b) return true;
  const auto first = ParseCommandBytes(a), second = ParseCommandBytes(b);
  if (!first || !second || !SamePath(*first, *second)) return false;
  // What this program does not know of a command must be the same bytes.
  if (UnknownBytes(*first) != UnknownBytes(*second)) return false;
  if (first->has_session_time_s() != second->has_session_time_s() ||
      !Near(first->session_time_s(), second->session_time_s()) ||
      first->covariates_size() != second->covariates_size())
    return false;
  return std::all_of(first->covariates().begin(), first->covariates().end(), [&](const auto& covariate) {
    const auto other = second->covariates().find(covariate.first);
    return other != second->covariates().end() && Near(other->second, covariate.second);
  });
}

}  // namespace touchstone::session
