#include "server/diagnosis/answers/session_poses.h"

#include <algorithm>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/answers/rules.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis {
namespace {

// What one model leaves of a session.
struct LeftBy {
  std::shared_ptr<const selection::Workspace> workspace;
  std::vector<double> residuals_s;
};

absl::StatusOr<LeftBy> WhatIsLeft(DiagnosisInput input, std::shared_ptr<const model::Model> model,
                                  const DiagnosisContext& context) {
  input.model = std::move(model);
  LeftBy left;
  TOUCHSTONE_ASSIGN_OR_RETURN(left.workspace, selection::MakeWorkspace(input, context));
  left.residuals_s = touches::Residuals(*left.workspace->observations, left.workspace->nominal);
  return left;
}

touches::PosedResiduals PosedOf(const LeftBy& left, const report::NoiseFloor& floor) {
  return {left.workspace->observations.get(), &left.residuals_s, floor.sigma * kSecondsPerMicrosecond,
          std::max(1.0, floor.degrees_of_freedom)};
}

}  // namespace

absl::StatusOr<std::vector<report::Sessions::Pair>> CompareSharedPoses(
    const std::vector<SessionOnPoses>& sessions, const DiagnosisContext& context) {
  std::vector<report::Sessions::Pair> pairs;
  LeftBy measured_before, left_before;
  for (size_t s = 0; s < sessions.size() && s <= kAnswerRules.max_session_pairs; ++s) {
    const SessionOnPoses& one = sessions[s];
    LeftBy measured, left;
    if (one.noise_floor && one.noise_floor->sigma > 0) {
      TOUCHSTONE_ASSIGN_OR_RETURN(measured, WhatIsLeft(one.input, one.input.model, context));
      left = measured;
      if (one.own != one.input.model) {
        TOUCHSTONE_ASSIGN_OR_RETURN(left, WhatIsLeft(one.input, one.own, context));
      }
    }
    if (measured.workspace != nullptr && measured_before.workspace != nullptr) {
      const report::NoiseFloor& floor_before = *sessions[s - 1].noise_floor;
      report::Sessions::Pair pair;
      pair.from = static_cast<int>(s) - 1, pair.to = static_cast<int>(s);
      pair.measured = touches::CompareSamePoses(PosedOf(measured_before, floor_before),
                                                PosedOf(measured, *one.noise_floor));
      pair.left =
          touches::CompareSamePoses(PosedOf(left_before, floor_before), PosedOf(left, *one.noise_floor));
      if (pair.measured.poses > 0) pairs.push_back(pair);
    }
    measured_before = std::move(measured), left_before = std::move(left);
  }
  return pairs;
}

}  // namespace touchstone::diagnosis
