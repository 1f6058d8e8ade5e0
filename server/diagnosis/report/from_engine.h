// What the engines of touches and of photographs find under the same names, as parts of a Diagnosis: all but errors, whose
// unit is the kind's.
#pragma once

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

template <typename EngineStep>
Step StepOf(const EngineStep& from) {
  return {from.effect,       from.scope,     from.equivalent, from.discriminating_measurement,
          from.probability,  from.gain_nats, from.parameters, from.meaning,
          from.check_on_rig, from.remedy,    from.words,      {},
          from.model};
}

template <typename EngineCandidate>
Candidate CandidateOf(const EngineCandidate& from, double rmse, double heldout_rmse) {
  return {from.effect,    from.scope,      from.note, from.probability,
          from.gain_nats, from.parameters, rmse,      heldout_rmse};
}

template <typename EngineRest>
Unexplained UnexplainedOf(const EngineRest& from, double rmse, double heldout_rmse) {
  return {from.covariates, from.formula, from.formula_yaml, from.lookup_yaml,
          from.words,      rmse,         heldout_rmse,      from.heldout_gain};
}

template <typename EngineProblem>
DataProblem DataProblemOf(const EngineProblem& from, double error_before, double error_after) {
  return {from.kind, from.detail, from.words, from.fix, error_before, error_after};
}

}  // namespace touchstone::diagnosis::report
