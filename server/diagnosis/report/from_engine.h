// What the engines of touches and of photographs find under the same names, as parts of a Diagnosis.
#pragma once

#include <vector>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

template <typename EngineStep>
Step StepOf(const EngineStep& from) {
  Step step;
  step.effect = from.effect;
  step.scope = from.scope;
  step.equivalent = from.equivalent;
  step.discriminating_measurement = from.discriminating_measurement;
  step.probability = from.probability;
  step.gain_nats = from.gain_nats;
  step.parameters = from.parameters;
  step.meaning = from.meaning;
  step.check_on_rig = from.check_on_rig;
  step.remedy = from.remedy;
  step.words = from.words;
  step.model = from.model;
  return step;
}

// Without errors.
template <typename EngineCandidate>
Candidate CandidateOf(const EngineCandidate& from) {
  Candidate candidate;
  candidate.effect = from.effect;
  candidate.scope = from.scope;
  candidate.note = from.note;
  candidate.probability = from.probability;
  candidate.gain_nats = from.gain_nats;
  candidate.parameters = from.parameters;
  return candidate;
}

// Without errors.
template <typename EngineRest>
Unexplained UnexplainedOf(const EngineRest& from) {
  Unexplained rest;
  rest.covariates = from.covariates;
  rest.formula = from.formula;
  rest.formula_yaml = from.formula_yaml;
  rest.lookup_yaml = from.lookup_yaml;
  rest.words = from.words;
  rest.heldout_gain = from.heldout_gain;
  return rest;
}

// Without errors.
template <typename EngineProblem>
DataProblem DataProblemOf(const EngineProblem& from) {
  DataProblem problem;
  problem.kind = from.kind;
  problem.detail = from.detail;
  problem.words = from.words;
  problem.fix = from.fix;
  return problem;
}

}  // namespace touchstone::diagnosis::report
