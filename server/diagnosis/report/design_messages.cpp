#include "server/diagnosis/report/design_messages.h"

namespace touchstone::diagnosis::report {
namespace {

void WriteVector(const Eigen::Vector3d& vector, v1::Vector3* message) {
  message->set_x(vector.x());
  message->set_y(vector.y());
  message->set_z(vector.z());
}

}  // namespace

void WriteProposedTouch(const design::ProposedTouch& proposed, v1::Report* report) {
  v1::ProposedTouch* message = report->add_next_touches();
  message->set_object(proposed.object);
  message->set_purpose(proposed.purpose);
  message->set_separation(proposed.separation_sigmas);
  message->set_touches_to_verdict(static_cast<uint32_t>(proposed.touches_to_verdict));
  v1::CommandedTouch* touch = message->mutable_touch();
  WriteVector(proposed.touch.target_m, touch->mutable_target_m());
  WriteVector(proposed.touch.approach, touch->mutable_approach());
  WriteVector(proposed.touch.lateral, touch->mutable_lateral());
  touch->set_standoff_m(proposed.touch.standoff_m);
  touch->set_speed_m_s(proposed.touch.speed_m_s);
  if (proposed.has_session_time) touch->set_session_time_s(proposed.touch.session_time_s);
  for (const auto& [name, value] : proposed.touch.covariates) (*touch->mutable_covariates())[name] = value;
}

}  // namespace touchstone::diagnosis::report
