#include "server/diagnosis/design/propose_photographs.h"

#include <algorithm>

#include "server/base/status.h"
#include "server/diagnosis/design/photo_prediction.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/design/sequential_choice.h"
#include "server/diagnosis/design/view_candidates.h"

namespace touchstone::diagnosis::design {

absl::StatusOr<std::vector<images::ProposedPhotograph>> ProposePhotographs(
    const images::Photographs& photographs, const images::ExplanationsLeft& left, int max_photographs,
    uint64_t seed, ThreadPool* pool) {
  std::vector<images::ProposedPhotograph> proposed;
  if (left.models.empty() || max_photographs <= 0 || photographs.size() == 0) return proposed;
  const std::vector<ViewCandidate> views = ListViews(photographs, kDesignRules.max_views, seed);
  std::vector<std::shared_ptr<const model::Model>> models;
  std::vector<std::string> names;
  for (const engine::ExplanationsLeft::NamedModel& explanation : left.models) {
    models.push_back(explanation.model);
    names.push_back(explanation.name);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<LinearisedPrediction> predictions,
                              LinearisePhotographs(models, photographs, left.noise, views, pool));
  std::vector<int> objects;
  for (const ViewCandidate& view : views) objects.push_back(view.object);
  for (const ChosenMeasurement& chosen :
       ChooseMeasurements(names, predictions, objects, static_cast<int>(photographs.objects.size()),
                          {max_photographs, kDesignRules.min_photo_separation.value()})) {
    const ViewCandidate& view = views[chosen.candidate];
    proposed.push_back({photographs.objects[view.object], view.camera, chosen.purpose,
                        chosen.separation_sigmas, chosen.to_verdict});
  }
  return proposed;
}

std::vector<images::ProposedPhotograph> PhotographsToBegin(const images::Photographs& photographs, int count,
                                                           uint64_t seed) {
  std::vector<images::ProposedPhotograph> proposed;
  for (const ViewCandidate& view :
       MostDifferentViews(photographs, ListViews(photographs, kDesignRules.max_views, seed), count))
    proposed.push_back(
        {photographs.objects[view.object], view.camera, "makes the set large enough for a verdict", 0, 0});
  return proposed;
}

}  // namespace touchstone::diagnosis::design
