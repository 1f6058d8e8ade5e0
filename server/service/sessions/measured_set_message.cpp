#include "server/service/sessions/measured_set_message.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <limits>

#include "server/base/status.h"
#include "server/session/measurements/measurement_checks.h"

namespace touchstone::service {
namespace {

using Doubles = google::protobuf::RepeatedField<double>;

void AddVectors(const std::vector<Eigen::Vector3d>& vectors, Doubles* field) {
  for (const Eigen::Vector3d& v : vectors)
    for (int i = 0; i < 3; ++i) field->Add(v[i]);
}

std::vector<Eigen::Vector3d> VectorsOf(const Doubles& field) {
  std::vector<Eigen::Vector3d> vectors;
  for (int k = 0; k + 2 < field.size(); k += 3) vectors.emplace_back(field[k], field[k + 1], field[k + 2]);
  return vectors;
}

}  // namespace

v1::MeasuredSet ToProto(const session::MeasurementSet& set) {
  v1::MeasuredSet message;
  message.mutable_objects()->Add(set.objects.begin(), set.objects.end());
  message.mutable_touch()->Add(set.touch.begin(), set.touch.end());
  message.mutable_object()->Add(set.object.begin(), set.object.end());
  AddVectors(set.target_m, message.mutable_target_m());
  AddVectors(set.approach, message.mutable_approach());
  AddVectors(set.lateral, message.mutable_lateral());
  message.mutable_standoff_m()->Add(set.standoff_m.begin(), set.standoff_m.end());
  message.mutable_speed_m_s()->Add(set.speed_m_s.begin(), set.speed_m_s.end());
  if (set.has_session_time)
    message.mutable_session_time_s()->Add(set.session_time_s.begin(), set.session_time_s.end());
  message.mutable_round()->Add(set.round.begin(), set.round.end());
  message.mutable_face()->Add(set.face.begin(), set.face.end());
  for (const auto& [name, values] : set.covariates)
    (*message.mutable_covariates())[name].mutable_values()->Add(values.begin(), values.end());
  message.set_fingers(set.fingers);
  message.mutable_contact_time_s()->Add(set.time_s.begin(), set.time_s.end());
  return message;
}

absl::StatusOr<session::MeasurementSet> FromProto(const v1::MeasuredSet& message, const std::string& origin,
                                                  const session::MeasurementLimits& limits) {
  session::MeasurementSet set;
  set.origin = origin;
  if (message.fingers() < 1 || message.fingers() > std::numeric_limits<uint16_t>::max())
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": set.fingers = ", message.fingers(), ": at least one was expected"));
  set.fingers = static_cast<int>(message.fingers());
  set.has_poses = true;
  set.has_session_time = !message.session_time_s().empty();
  set.objects.assign(message.objects().begin(), message.objects().end());
  set.touch.assign(message.touch().begin(), message.touch().end());
  for (const uint32_t object : message.object())
    set.object.push_back(object < set.objects.size() ? static_cast<int>(object) : -1);
  set.target_m = VectorsOf(message.target_m());
  set.approach = VectorsOf(message.approach());
  set.lateral = VectorsOf(message.lateral());
  set.standoff_m.assign(message.standoff_m().begin(), message.standoff_m().end());
  set.speed_m_s.assign(message.speed_m_s().begin(), message.speed_m_s().end());
  set.session_time_s.assign(message.session_time_s().begin(), message.session_time_s().end());
  if (!set.has_session_time) set.session_time_s.assign(set.object.size(), 0);
  set.round.assign(message.round().begin(), message.round().end());
  set.face.assign(message.face().begin(), message.face().end());
  for (const auto& [name, column] : message.covariates()) {
    if (!absl::StartsWith(name, "cov_"))
      return absl::InvalidArgumentError(
          absl::StrCat(origin, ": set.covariates['", name, "']: names begin with 'cov_'"));
    set.covariates[name].assign(column.values().begin(), column.values().end());
  }
  set.time_s.assign(message.contact_time_s().begin(), message.contact_time_s().end());
  for (int row = 0; row < set.size(); ++row) set.line.push_back(row + 2);  // below a header
  TOUCHSTONE_RETURN_IF_ERROR(session::CheckMeasurementSet(&set, limits));
  return set;
}

}  // namespace touchstone::service
