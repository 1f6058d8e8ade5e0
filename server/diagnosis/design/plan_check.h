// What a plan of touches can find before it is made: detectability.h for touches that were not measured.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/design/propose.h"
#include "server/diagnosis/engine/competition/detectability.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis::design {

struct PlanQuestion {
  double sigma_s = 0;  // noise of one finger's time; 0: the model's own
  int improve = 0;     // touches to propose
  // What they are for, if any are asked for; one of the two: an effect that is to be found at smaller sizes, or two that
  // are to be told apart.
  std::string find;
  std::vector<std::string> between;
};

struct PlanCheck {
  std::unique_ptr<selection::Workspace> workspace;  // with the model's own times as those that were measured
  double sigma_s = 0;
  std::vector<engine::DetectableValue> values;
  std::vector<ProposedTouch> proposed;  // most helpful first
};

// The same touches with times, all 0: which finger reports and when is the model's business.
DiagnosisInput AsPlan(const DiagnosisInput& input);

// `input`: a set of touches with poses, whose times are not read. Errors: a model without noise where none is given, an
// effect that the plan's search has not, what MakeWorkspace finds.
absl::StatusOr<PlanCheck> CheckPlan(const DiagnosisInput& input, const PlanQuestion& question,
                                    const DiagnosisContext& context);

}  // namespace touchstone::diagnosis::design
