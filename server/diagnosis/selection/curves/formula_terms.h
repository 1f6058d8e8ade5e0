// A dictionary of simple terms that a rest may follow when no effect of the catalogue does: a factor that differs
// from finger to finger, times a covariate or a function of one, as people would write it in a model file.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/touches/touch_observation_model.h"

namespace touchstone::diagnosis::selection {

struct FormulaTerm {
  std::string covariate;   // "approach_z"
  std::string expression;  // with its parameters: "k * (finger == 0) * approach_z"
  bool adds_time = false;
  std::vector<model::ParameterInfo> parameters;  // in the units of files
  std::vector<double> values;                    // where a fit starts
  double gain_nats = 0;  // log evidence over the fit without it, less its complexity penalty
  double log_ratio = 0;  // of the likelihoods
  int degrees_of_freedom = 1;
};

// Every term's gain over `fit`, best first. `details` are of the fit's model, with curvature.
std::vector<FormulaTerm> ScoreTerms(const engine::Experiment& experiment,
                                    const touches::TouchObservationModel& touches, const engine::Fit& fit,
                                    const touches::Prediction& details);

// What an effect of this covariate is called in a model, formula or curve.
std::string NameOfRest(const std::string& covariate);

// The term as an effect of this name.
absl::StatusOr<std::shared_ptr<const model::Effect>> MakeTermEffect(const std::string& name,
                                                                    const FormulaTerm& term);

// Two terms in one expression: parameters of the second are renamed where they clash.
FormulaTerm Sum(const FormulaTerm& a, const FormulaTerm& b);

}  // namespace touchstone::diagnosis::selection
