#include "server/diagnosis/report/message/write_report.h"

#include "server/diagnosis/report/message/message_parts.h"
#include "server/diagnosis/report/message/write_answers.h"
#include "server/diagnosis/report/message/write_data_report.h"
#include "server/diagnosis/report/message/write_sessions.h"
#include "server/diagnosis/report/words/model_text.h"
#include "server/uncertainty/posterior_message.h"

namespace touchstone::diagnosis::report {
namespace {

void WriteVector(const Eigen::Vector3d& vector, v1::Vector3* message) {
  message->set_x(vector.x());
  message->set_y(vector.y());
  message->set_z(vector.z());
}

void WriteStep(const Step& step, v1::Step* message) {
  message->set_effect(step.effect);
  *message->mutable_equivalent() = {step.equivalent.begin(), step.equivalent.end()};
  message->set_probability(step.probability);
  WriteParameters(step.parameters, message->mutable_parameters());
  message->set_gain_nats(step.gain_nats);
  message->set_meaning(step.meaning);
  message->set_check_on_rig(step.check_on_rig);
  message->set_remedy(step.remedy);
  message->set_discriminating_measurement(step.discriminating_measurement);
  *message->mutable_scope() = ScopeMessage(step.scope, step.parameters);
  message->set_words(step.words);
  for (const DataKind kind : step.shown_by) message->add_shown_by(ToMessage(kind));
}

v1::DataProblem::Kind KindMessage(engine::ProblemKind kind) {
  static_assert(static_cast<int>(engine::ProblemKind::kSaturatedTimes) + 1 ==
                v1::DataProblem::SATURATED_TIMES);
  return static_cast<v1::DataProblem::Kind>(static_cast<int>(kind) + 1);
}

void WriteDataProblem(const DataProblem& problem, v1::DataProblem* message) {
  message->set_kind(KindMessage(problem.kind));
  message->set_detail(problem.detail);
  message->set_words(problem.words);
  message->set_fix(problem.fix);
  message->set_error_before(problem.error_before);
  message->set_error_after(problem.error_after);
  message->set_data_index(static_cast<uint32_t>(problem.data_index));
}

void WriteNext(const design::ProposedTouch& proposed, v1::NextMeasurement* message) {
  message->set_object(proposed.object);
  message->set_purpose(proposed.purpose);
  message->set_separation(proposed.separation_sigmas);
  message->set_count_to_verdict(static_cast<uint32_t>(proposed.touches_to_verdict));
  v1::CommandedTouch* touch = message->mutable_touch();
  WriteVector(proposed.touch.target_m, touch->mutable_target_m());
  WriteVector(proposed.touch.approach, touch->mutable_approach());
  WriteVector(proposed.touch.lateral, touch->mutable_lateral());
  touch->set_standoff_m(proposed.touch.standoff_m);
  touch->set_speed_m_s(proposed.touch.speed_m_s);
  if (proposed.has_session_time) touch->set_session_time_s(proposed.touch.session_time_s);
  for (const auto& [name, value] : proposed.touch.covariates) (*touch->mutable_covariates())[name] = value;
}

void WriteNext(const images::ProposedPhotograph& proposed, v1::NextMeasurement* message) {
  message->set_object(proposed.object);
  message->set_purpose(proposed.purpose);
  message->set_separation(proposed.separation);
  message->set_count_to_verdict(static_cast<uint32_t>(proposed.photographs_to_verdict));
  v1::CameraPose* camera = message->mutable_photograph();
  WriteVector(proposed.camera.eye_m, camera->mutable_eye_m());
  WriteVector(proposed.camera.at_m, camera->mutable_at_m());
  WriteVector(proposed.camera.up, camera->mutable_up());
}

void WriteCauses(const Diagnosis& diagnosis, v1::Report* report) {
  for (const DataProblem& problem : diagnosis.data_problems)
    WriteDataProblem(problem, report->add_data_problems());
  *report->mutable_superfluous() = {diagnosis.superfluous.begin(), diagnosis.superfluous.end()};
  for (const engine::RefittedEffect& refit : diagnosis.refitted) {
    v1::Refit* message = report->add_refitted();
    message->set_effect(refit.effect);
    WriteParameters(refit.parameters, message->mutable_parameters());
  }
  for (const Step& step : diagnosis.steps) WriteStep(step, report->add_steps());
  for (const engine::ConfoundedEffects& confounded : diagnosis.confounded) {
    v1::Ambiguity* message = report->add_ambiguities();
    *message->mutable_effects() = {confounded.effects.begin(), confounded.effects.end()};
    message->set_discriminating_measurement(confounded.discriminating_measurement);
  }
}

// Every model file of the report.
void WriteModels(const Diagnosis& diagnosis, v1::Report* report) {
  if (diagnosis.improved_model) {
    report->set_improved_model_yaml(ImprovedModelText(diagnosis, *diagnosis.improved_model));
    report->set_improved_model_hash(diagnosis.improved_model->Hash());
  }
  for (size_t i = 0; i < diagnosis.data.size(); ++i)
    if (diagnosis.data[i].unexplained && diagnosis.data[i].unexplained->model_with)
      report->mutable_data(static_cast<int>(i))
          ->mutable_unexplained()
          ->set_model_yaml(SuggestedModelText(diagnosis, static_cast<int>(i)));
  if (!diagnosis.sessions || !diagnosis.sessions->changes) return;
  const Sessions& sessions = *diagnosis.sessions;
  v1::SessionComparison* message = report->mutable_sessions();
  for (int session = 0; session < sessions.count; ++session) message->add_model_yaml("");
  for (size_t i = 0; i < sessions.taking_part.size(); ++i)
    message->set_model_yaml(sessions.taking_part[i],
                            ImprovedModelText(diagnosis, sessions.changes->models[i]));
}

}  // namespace

v1::Report ToReport(const Diagnosis& diagnosis) {
  v1::Report report;
  report.set_verdict(ToMessage(diagnosis.verdict));
  report.set_summary(diagnosis.summary);
  *report.mutable_warnings() = {diagnosis.warnings.begin(), diagnosis.warnings.end()};
  report.set_model_name(diagnosis.model_name);
  report.set_model_hash(diagnosis.model_hash);
  WriteCauses(diagnosis, &report);
  for (const DataReport& data : diagnosis.data) *report.add_data() = ToMessage(data);
  if (diagnosis.p_nothing_missing) report.set_p_nothing_missing(*diagnosis.p_nothing_missing);
  report.set_hypotheses_tried(static_cast<uint32_t>(diagnosis.hypotheses_tried));
  WriteModels(diagnosis, &report);
  for (const NextMeasurement& next : diagnosis.next)
    std::visit([&report](const auto& proposed) { WriteNext(proposed, report.add_next()); }, next);
  for (const engine::DetectableValue& value : diagnosis.detectable)
    WriteDetectable(value, report.add_detectable());
  if (diagnosis.explained)
    WriteExplanation(*diagnosis.explained, diagnosis.data[0].fingers, report.mutable_explained());
  if (diagnosis.sessions) WriteSessions(*diagnosis.sessions, report.mutable_sessions());
  if (diagnosis.posterior) *report.mutable_posterior() = uncertainty::ToMessage(*diagnosis.posterior);
  for (const uncertainty::Budget& budget : diagnosis.uncertainty)
    *report.add_uncertainty() = uncertainty::ToMessage(budget);
  report.set_duration_s(diagnosis.duration_s);
  return report;
}

}  // namespace touchstone::diagnosis::report
