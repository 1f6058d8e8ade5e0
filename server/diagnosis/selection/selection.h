// Why: the best explanation of the residuals. Effects, values set free, a formula for what the catalogue does not
// have, the kind of noise, a surface error; and what else fits as well.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/inference/noise_kinds.h"
#include "server/diagnosis/selection/formula_terms.h"
#include "server/diagnosis/selection/nameless_curve.h"
#include "server/diagnosis/selection/noise_memory.h"
#include "server/diagnosis/selection/partial_offset.h"
#include "server/diagnosis/selection/stepwise_search.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis::selection {

// Another way to explain what one step explains.
struct CompetingEffect {
  std::string name;
  bool per_object = false;
  std::string object;                // the only one on which it acts; empty: on all
  double relative_log_evidence = 0;  // nats, over the step's own
  bool equivalent = false;           // these data cannot tell it from the step
  bool stopped = false;              // ... if its value could go beyond its bound
  model::Model model;                // the whole model with it
};

// A curve of time in the place of a named effect.
struct CurveRival {
  double ahead_nats = 0;  // log evidence over the effect's own
  std::string words;      // a sentence that says what it is
};

struct SelectedStep {
  int effect = 0;                          // index in the fit's model
  double gain_nats = 0;                    // over the fit without it
  double probability = 0;                  // with its equivalents, among all that could take its place
  std::vector<CompetingEffect> competing;  // best first
  std::string words;                       // a curve that says nearly the same; empty: none does
};

// A smooth error of the surfaces, in the final fit.
struct SurfaceErrorFinding {
  double gain_nats = 0;  // evidence of any over none
  double rms_m = 0, length_m = 0;
  double effective_dof = 0;
};

struct SelectionResult {
  std::unique_ptr<StepwiseSearch> search;  // the experiment that it works on belongs to the workspace
  inference::Fit initial_model;            // as it was given
  inference::Fit fit;                      // everything: effects, refits, formula
  inference::Fit without_formula;          // the same if there is no formula
  int initial_effects = 0;                 // effects below this index are the initial model's
  int formula = -1;                        // index of the formula's or the curve's effect in fit.model
  FormulaTerm term;
  std::vector<FormulaTerm> terms;      // scored on what the named effects leave; empty if there is no formula
  std::vector<NamelessCurve> curves;   // over what the named effects leave, largest gain first
  std::optional<NamelessCurve> curve;  // the one that explains the rest, or stands beside the formula
  std::map<std::string, CurveRival> curve_rivals;  // by the effect whose place they would take
  std::vector<SelectedStep> steps;
  inference::NoiseFindings noise;
  std::optional<NoiseMemory>
      memory;  // the wander that the residuals follow, where no curve describes them better
  std::optional<PartialOffset> partial;  // that a part of the touches has: no effect is named in its place
  SurfaceErrorFinding surface_error;
};

// Whether a value of effect `index` ended at a bound that is not the value that changes nothing.
bool IsAtBound(const inference::Fit& fit, int index);

// Of an explanation whose evidence has this share, as a logarithm, of the evidence of all: the one place that keeps
// probabilities at or below kMaxProbability.
double ProbabilityOfShare(double log_share);
// The same from a log of odds, nats.
double ProbabilityOf(double log_odds);

// Leaves touches out of workspace->observations (edges, outliers) and weighs the rest as the noise asks for.
absl::StatusOr<SelectionResult> SelectExplanation(Workspace* workspace);

// Residuals [k * fingers + i], s, of a fit on the searched touches, without what its surface hypothesis explains.
std::vector<double> ResidualsWithoutSurface(const Workspace& workspace, const inference::Fit& fit);

// Log evidence of any surface error over none, nats.
double SurfaceErrorNats(const Workspace& workspace, const inference::Fit& fit);

}  // namespace touchstone::diagnosis::selection
