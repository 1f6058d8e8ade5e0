// Sessions on the poses that two of them touched, whatever the model and under each session's own.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis {

struct SessionOnPoses {
  DiagnosisInput input;                           // with the given model, without effects of photographs
  std::shared_ptr<const model::Model> own;        // the session's, likewise
  std::optional<report::NoiseFloor> noise_floor;  // us; none: the session is not compared
};

// Each session with the one before it, the first eight pairs; pairs without a common pose are left out. Errors as
// MakeWorkspace.
absl::StatusOr<std::vector<report::Sessions::Pair>> CompareSharedPoses(
    const std::vector<SessionOnPoses>& sessions, const DiagnosisContext& context);

}  // namespace touchstone::diagnosis
