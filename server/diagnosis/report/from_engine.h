// What the engine finds, as parts of a Diagnosis: all but errors, whose unit is the kind's.
#pragma once

#include "server/diagnosis/engine/result.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

inline Step StepOf(const engine::LadderStep& from) {
  return {from.effect,       from.scope,     from.equivalent, from.discriminating_measurement,
          from.probability,  from.gain_nats, from.parameters, from.meaning,
          from.check_on_rig, from.remedy,    from.words,      {},
          from.model};
}

inline Candidate CandidateOf(const engine::RankedCandidate& from, double rmse, double heldout_rmse) {
  return {from.effect,    from.scope,      from.note, from.probability,
          from.gain_nats, from.parameters, rmse,      heldout_rmse};
}

inline Unexplained UnexplainedOf(const engine::UnexplainedRest& from, double rmse, double heldout_rmse) {
  return {from.covariates, from.formula, from.formula_yaml, from.lookup_yaml,
          from.words,      rmse,         heldout_rmse,      from.heldout_gain,
          from.parameters, from.nearest_effect, from.nearest_formula, from.nearest_cosine,
          from.nearest_formula_share, from.lookup};
}

inline DataProblem DataProblemOf(const engine::DataProblem& from, double error_before, double error_after) {
  return {from.kind, from.detail, from.words, from.fix, error_before, error_after};
}

}  // namespace touchstone::diagnosis::report
