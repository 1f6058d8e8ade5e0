// Pieces of messages that reports of touches and of photographs share.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/engine/parameter_estimate.h"
#include "server/diagnosis/engine/result.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

v1::Report::Verdict ToMessage(engine::Verdict verdict);
const char* ToMessage(engine::EffectScope scope);
const char* ToMessage(engine::CandidateNote note);

template <typename Message>
void WriteParameters(const std::vector<engine::ParameterEstimate>& parameters, Message* message) {
  for (const engine::ParameterEstimate& estimate : parameters) {
    v1::ParameterValue* value = message->add_parameters();
    value->set_name(estimate.name);
    value->set_value(estimate.value);
    value->set_std_error(estimate.std_error);
    value->set_unit(estimate.unit);
    value->set_finger(estimate.entry);
    value->set_object(estimate.object);
    value->set_lower(estimate.lower);
    value->set_upper(estimate.upper);
    if (estimate.before) value->set_before(*estimate.before);
    for (const auto& [kind, std_error] : estimate.std_error_alone)
      kind == "touches" ? value->set_std_error_touches(std_error)
                        : value->set_std_error_photographs(std_error);
  }
}

// What a step says beside its errors, which are times or grey levels.
template <typename LadderStep>
void WriteStepWithoutErrors(const LadderStep& step, v1::Step* message) {
  message->set_effect(step.effect);
  for (const std::string& name : step.equivalent) message->add_equivalent(name);
  message->set_probability(step.probability);
  WriteParameters(step.parameters, message);
  message->set_lack_of_fit_p(step.quality.lack_of_fit_p);
  message->set_gain_nats(step.gain_nats);
  message->set_meaning(step.meaning);
  message->set_check_on_rig(step.check_on_rig);
  message->set_remedy(step.remedy);
  message->set_discriminating_measurement(step.discriminating_measurement);
  message->set_scope(ToMessage(step.scope));
  message->set_words(step.words);
}

// The same of a candidate.
template <typename Candidate>
void WriteCandidateWithoutErrors(const Candidate& candidate, v1::Candidate* message) {
  message->set_effect(candidate.effect);
  WriteParameters(candidate.parameters, message);
  message->set_probability(candidate.probability);
  message->set_gain_nats(candidate.gain_nats);
  message->set_note(ToMessage(candidate.note));
  message->set_scope(ToMessage(candidate.scope));
}

// The same of what no effect explains: what it depends on, and what is suggested.
template <typename Rest>
void WriteRestWithoutErrors(const Rest& rest, v1::Unexplained* message) {
  for (const engine::CovariateTest& test : rest.covariates) {
    v1::CovariateTest* covariate = message->add_covariates();
    covariate->set_name(test.name);
    covariate->set_p(test.p);
    covariate->set_gain_nats(test.gain_nats);
  }
  message->set_formula(rest.formula);
  message->set_formula_yaml(rest.formula_yaml);
  message->set_lookup_yaml(rest.lookup_yaml);
  message->set_heldout_gain(rest.heldout_gain);
  message->set_words(rest.words);
}

// The same of a mistake in the data.
template <typename Problem>
void WriteProblemWithoutErrors(const Problem& problem, v1::DataProblem* message) {
  message->set_kind(problem.kind);
  message->set_detail(problem.detail);
  message->set_words(problem.words);
  message->set_fix(problem.fix);
}

// Of a diagnosis: refitted values, effects that cannot be told apart, superfluous ones, the improved model.
template <typename AnyDiagnosis>
void WriteModelChanges(const AnyDiagnosis& diagnosis, v1::Report* report) {
  for (const engine::RefittedEffect& refit : diagnosis.refitted) {
    v1::Refit* message = report->add_refitted();
    message->set_effect(refit.effect);
    WriteParameters(refit.parameters, message);
  }
  for (const engine::ConfoundedEffects& confounded : diagnosis.confounded) {
    v1::Ambiguity* message = report->add_ambiguities();
    for (const std::string& effect : confounded.effects) message->add_effects(effect);
    message->set_discriminating_measurement(confounded.discriminating_measurement);
  }
  for (const std::string& effect : diagnosis.superfluous) report->add_superfluous(effect);
  report->set_improved_model_yaml(diagnosis.improved_model_yaml);
  report->set_improved_model_hash(diagnosis.improved_model_hash);
}

}  // namespace touchstone::diagnosis::report
