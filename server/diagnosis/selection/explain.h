// Why: the best explanation of a study's residuals. Effects, values set free, a formula for what the
// catalogue does not have, the kind of noise, a surface error; and what else fits as well.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/inference/noise_kinds.h"
#include "server/diagnosis/selection/formula_terms.h"
#include "server/diagnosis/selection/search.h"
#include "server/diagnosis/selection/study.h"

namespace touchstone {

// Another way to explain what one step explains.
struct Rival {
  std::string name;
  bool per_object = false;
  double evidence = 0;      // relative to the step's own
  bool equivalent = false;  // these data cannot tell it from the step
  Model model;              // the whole model with it
};

struct ExplainedStep {
  int effect = 0;          // index in the fit's model
  double gain_nats = 0;    // over the fit without it
  double probability = 0;  // with its equivalents, among all that could take its place
  std::vector<Rival> rivals;
};

struct Explained {
  std::unique_ptr<Search> search;  // the experiment that it works on belongs to the study
  Fit given;                       // the model as it was given
  Fit fit;                         // everything: effects, refits, formula
  Fit without_formula;             // the same if there is no formula
  int given_effects = 0;           // effects below this index are the given model's
  int formula = -1;                // index of the formula's effect in fit.model
  FormulaTerm term;
  std::vector<FormulaTerm> terms;  // scored on what the named effects leave
  std::vector<ExplainedStep> steps;
  NoiseFindings noise;
  // Evidence for bumps of the surface, in the final fit.
  double surface_nats = 0;
  double surface_rms_m = 0, surface_length_m = 0, surface_degrees = 0;
};

absl::StatusOr<Explained> Explain(Study* study);

// Residuals [k * fingers + i] of a fit on the searched touches, without what its surface hypothesis explains.
std::vector<double> ResidualsWithoutSurface(const Study& study, const Fit& fit);

// Evidence of any surface error over none, nats, and its most probable size.
double SurfaceEvidence(const Study& study, const Fit& fit);

}  // namespace touchstone
