// Why: the best explanation of the residuals. Effects, values set free, a formula for what the catalogue does not
// have, the kind of noise, a surface error; and what else fits as well.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/selection/curves/formula_terms.h"
#include "server/diagnosis/selection/curves/nameless_curve.h"
#include "server/diagnosis/selection/scatter/noise_memory.h"
#include "server/diagnosis/selection/session/partial_offset.h"
#include "server/diagnosis/selection/workspace.h"
#include "server/diagnosis/touches/noise/noise_kinds.h"

namespace touchstone::diagnosis::selection {

// A smooth error of the surfaces, in the final fit.
struct SurfaceErrorFinding {
  double gain_nats = 0;  // evidence of any over none
  double rms_m = 0, length_m = 0;
  double effective_dof = 0;
};

// A part of the session in which something was other than in the rest (group_difference.h).
struct GroupDifference {
  std::string effect;                           // of the catalogue, or of the given model
  std::vector<std::string> also;                // effects that these data cannot tell from it
  std::string part;                             // "in round 2"
  std::vector<int> rows;                        // of the set, in that part
  std::vector<engine::ParameterEstimate> more;  // by how much its values differ there from those in the rest
  // That it depends on the round, or on the touch's place in the session; BIC, less the number of ways that were tried.
  engine::CovariateTest test;
  std::string words;  // sentences for people
};

struct SelectionResult {
  std::unique_ptr<engine::StepwiseSearch> search;  // the experiment that it works on belongs to the workspace
  engine::Fit initial_model;                       // as it was given
  engine::Fit fit;                                 // everything: effects, refits, formula
  engine::Fit without_formula;                     // the same if there is no formula
  int initial_effects = 0;                         // effects below this index are the initial model's
  int formula = -1;  // index of the formula's or the curve's effect in fit.model
  FormulaTerm term;
  std::vector<FormulaTerm> terms;      // scored on what the named effects leave; empty if there is no formula
  std::vector<NamelessCurve> curves;   // over what the named effects leave, largest gain first
  std::optional<NamelessCurve> curve;  // the one that explains the rest, or stands beside the formula
  std::map<std::string, engine::NamelessRival> nameless_rivals;  // by the effect whose place they would take
  std::vector<engine::SelectedStep> steps;
  engine::TriedPValues tried;  // of the model as it was given, over all that is tried
  touches::NoiseFindings noise;
  std::optional<NoiseMemory>
      memory;  // the correlated noise that the residuals follow, where no curve describes them better
  std::optional<GroupDifference> group;  // its touches are left out of the explanation
  std::optional<PartialOffset> partial;  // that a part of the touches has: no effect is named in its place
  SurfaceErrorFinding surface_error;
};

// Keeps the nearest of what has no name and competes with an effect that was found.
void NoteRival(const std::string& effect, const engine::NamelessRival& rival, SelectionResult* result);

// What competes with each step of the explanation as it stands.
absl::Status FindCompetingEffects(SelectionResult* result);

// Leaves touches out of workspace->observations (edges, outliers) and weighs the rest as the noise asks for.
absl::StatusOr<SelectionResult> SelectExplanation(Workspace* workspace);

// Residuals [k * fingers + i], s, of a fit on the searched touches, without what its surface hypothesis explains.
std::vector<double> ResidualsWithoutSurface(const Workspace& workspace, const engine::Fit& fit);

// Log evidence of any surface error over none, nats.
double SurfaceErrorNats(const Workspace& workspace, const engine::Fit& fit);

}  // namespace touchstone::diagnosis::selection
