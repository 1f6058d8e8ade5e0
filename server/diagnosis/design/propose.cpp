#include "server/diagnosis/design/propose.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/design/linearised_prediction.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/design/sequential_choice.h"
#include "server/diagnosis/design/touch_candidates.h"

namespace touchstone::diagnosis::design {
namespace {

// The observations, or runs of them spread over the session.
touches::Observations PresentData(const touches::Observations& observations) {
  std::vector<int> keep;
  const int run_length = kDesignRules.run_length, max_present = kDesignRules.max_present;
  const int runs = (observations.size() + run_length - 1) / run_length;
  const int run_step = std::max(1, (observations.size() + max_present - 1) / max_present);
  for (int run = 0; run < runs; run += run_step)
    for (int k = run * run_length; k < std::min(observations.size(), (run + 1) * run_length); ++k)
      keep.push_back(k);
  return PartOf(observations, keep);
}

ProposedTouch TouchOf(const touches::Observations& candidates, int k) {
  const session::MeasurementSet& set = *candidates.set;
  const int row = candidates.row[k];
  ProposedTouch proposed;
  proposed.object = candidates.objects[candidates.object[k]];
  proposed.touch.target_m = set.target_m[row];
  proposed.touch.approach = set.approach[row];
  proposed.touch.lateral = set.lateral[row];
  proposed.touch.standoff_m = set.standoff_m[row];
  proposed.touch.speed_m_s = set.speed_m_s[row];
  proposed.has_session_time = set.has_session_time;
  if (set.has_session_time) proposed.touch.session_time_s = set.session_time_s[row];
  for (const auto& [name, values] : set.covariates) proposed.touch.covariates[name] = values[row];
  return proposed;
}

bool Drifts(const model::Model& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const model::EffectInstance& instance) {
    return instance.effect->needs.session_time;
  });
}

}  // namespace

absl::StatusOr<std::vector<ProposedTouch>> ProposeTouches(
    const touches::Observations& observations,
    const std::vector<engine::ExplanationsLeft::NamedModel>& models, double sigma_s, int max_touches,
    uint64_t seed, ThreadPool* pool) {
  if (models.empty())
    return absl::InvalidArgumentError("to propose touches takes at least one fitted model, got none");
  if (!(sigma_s > 0) || max_touches <= 0 || observations.size() == 0) return std::vector<ProposedTouch>();

  CandidateChoice choice;
  choice.seed = seed;
  for (const engine::ExplanationsLeft::NamedModel& competing : models)
    choice.different_times |= Drifts(*competing.model);
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations candidates,
                              MakeCandidates(observations, *models[0].model, choice, pool));
  if (candidates.size() == 0) return std::vector<ProposedTouch>();

  const touches::Observations present = PresentData(observations);
  const double weight = double(observations.size()) / present.size();
  std::vector<LinearisedPrediction> predictions;
  for (const engine::ExplanationsLeft::NamedModel& competing : models) {
    TOUCHSTONE_ASSIGN_OR_RETURN(LinearisedPrediction prediction,
                                Linearise(*competing.model, present, weight, candidates, sigma_s, pool));
    predictions.push_back(std::move(prediction));
  }
  std::vector<std::string> names;
  for (const engine::ExplanationsLeft::NamedModel& competing : models) names.push_back(competing.name);
  std::vector<ProposedTouch> proposed;
  for (const ChosenMeasurement& chosen :
       ChooseMeasurements(names, predictions, candidates.object, static_cast<int>(candidates.objects.size()),
                          {max_touches})) {
    ProposedTouch touch = TouchOf(candidates, chosen.candidate);
    touch.purpose = chosen.purpose;
    touch.separation_sigmas = chosen.separation_sigmas;
    touch.touches_to_verdict = chosen.to_verdict;
    proposed.push_back(std::move(touch));
  }
  return proposed;
}

}  // namespace touchstone::diagnosis::design
