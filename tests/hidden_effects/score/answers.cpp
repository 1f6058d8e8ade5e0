#include "tests/hidden_effects/score/answers.h"

#include <utility>

#include "tests/hidden_effects/generator/unlisted.h"

namespace touchstone::hidden {
namespace {

// What the rest may be said to depend on.
std::vector<std::string> CovariatesOf(CauseKind kind) {
  switch (kind) {
    case CauseKind::kSessionWave:
    case CauseKind::kWarmUp:
    case CauseKind::kMidSession:
    case CauseKind::kNoiseWithMemory:
    case CauseKind::kRandomWalk:
      return {"session_time", "time", "touch", "place", "order", "session"};
    case CauseKind::kIncidenceWave:
      return {"incidence", "tan_incidence", "tan(incidence"};
    case CauseKind::kFingerCoupling:
      return {"travel", "first", "curvature", "finger", "gap", "neighbour"};
    case CauseKind::kSlipOnOneObject:
    case CauseKind::kPushOnOneObject:
      return {"object"};
    case CauseKind::kSlipInOneRound:
    case CauseKind::kPushInOneRound:
      return {"round"};
    case CauseKind::kRemounted:
      return {"round", "session_time", "time", "touch", "place", "order", "session"};
    case CauseKind::kPoseError:
      return {"pose"};
  }
  return {};
}

// The effect that describes it, with words about where or when it acts; empty: none does.
std::string NameOf(CauseKind kind) {
  switch (kind) {
    case CauseKind::kNoiseWithMemory:
    case CauseKind::kRandomWalk:
      return "correlated_noise";
    case CauseKind::kSlipOnOneObject:
    case CauseKind::kSlipInOneRound:
      return "oblique_slip";
    case CauseKind::kPushOnOneObject:
    case CauseKind::kPushInOneRound:
      return "object_push";
    case CauseKind::kRemounted:
      return "object_pose";
    case CauseKind::kPoseError:
      return "pose_error";
    default:
      return "";
  }
}

}  // namespace

Answer AnswerFor(const Arm& arm, const Scenario& truth) {
  Answer answer;
  answer.names = arm.tolerated;
  for (const Hidden& hidden : truth.hidden) {
    answer.names.push_back(hidden.effect);
    // A latency beside the old length is not what happened.
    if (arm.kind == Kind::kOldValue) continue;
    for (std::string& other : EquivalentEffects(hidden, truth)) answer.names.push_back(std::move(other));
  }
  for (const Hidden& given : truth.in_model) {
    answer.names.push_back("given:" + given.effect);
    if (!truth.hidden.empty()) answer.names.push_back(given.effect);
  }
  if (!truth.noise_in_model) answer.names.push_back("gaussian_noise");
  for (const Unlisted& unlisted : truth.unlisted) answer.covariates = FindUnlisted(unlisted.name).covariates;
  for (const Cause& cause : truth.causes) {
    answer.covariates = CovariatesOf(cause.kind);
    if (const std::string name = NameOf(cause.kind); !name.empty()) answer.names.push_back(name);
  }
  for (const DataError& data_error : truth.data_errors) answer.problems = ProblemKinds(data_error);
  return answer;
}

}  // namespace touchstone::hidden
