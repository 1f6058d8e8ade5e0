#include "server/diagnosis/engine/ladder/improvement.h"

#include <utility>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/ladder.h"

namespace touchstone::diagnosis::engine {

absl::StatusOr<std::vector<int>> ImproveValues(const Experiment& experiment, const Fit& selected,
                                               const Fit& values, const Eigen::MatrixXd& covariance,
                                               const model::Model& given,
                                               const std::vector<std::string>& objects,
                                               Improvement* improvement) {
  improvement->improved = values.model.base();
  RoundValues(values, &improvement->improved);
  TOUCHSTONE_ASSIGN_OR_RETURN(GivenEffects found,
                              DescribeGivenEffects(experiment, selected, values, covariance, given, objects));
  for (const int index : found.superfluous)
    improvement->improved.effects.erase(improvement->improved.effects.begin() + index);
  improvement->values_wrong = found.changed();
  improvement->changed |= found.changed();
  improvement->superfluous = std::move(found.superfluous_names);
  improvement->refitted = std::move(found.refitted);
  return std::move(found.superfluous);
}

bool KeepGivenIfWorse(const model::Model& given, const Quality& initial, const Quality& final,
                      Improvement* improvement) {
  if (!improvement->steps.empty() || !improvement->values_wrong || !(final.rmse > initial.rmse)) return false;
  improvement->improved = given;
  improvement->refitted.clear(), improvement->superfluous.clear();
  improvement->values_wrong = improvement->changed = false;
  return true;
}

LadderStep& AddStep(const Fit& values, const Eigen::MatrixXd& covariance, const SelectedStep& from,
                    const model::Model& model, const Quality& quality, Improvement* improvement) {
  LadderStep& step = improvement->steps.emplace_back(DescribeStep(values, covariance, from));
  AddConfounded(step, &improvement->confounded);
  step.model = model;
  step.quality = quality;
  improvement->changed = true;
  return step;
}

LadderStep& AddNoiseStep(const std::shared_ptr<const model::Effect>& effect, std::vector<double> values,
                         std::vector<ParameterEstimate> estimates, double probability, const Quality& quality,
                         Improvement* improvement) {
  improvement->improved.effects.push_back({effect, false, std::move(values), {}});
  improvement->changed = true;
  LadderStep& step = improvement->steps.emplace_back();
  step.effect = effect->name;
  AddTexts(*effect, &step);
  step.probability = probability;
  step.parameters = std::move(estimates);
  step.quality = quality;
  return step;
}

Verdict VerdictOf(bool rest, bool steps, bool values_wrong) {
  return rest           ? Verdict::kUnexplained
         : steps        ? Verdict::kMissingEffects
         : values_wrong ? Verdict::kWrongValues
                        : Verdict::kAdequate;
}

void Conclude(const Hypotheses& found, double explained_share, Improvement* improvement) {
  improvement->verdict =
      VerdictOf(found.Leave(Leaves::kBeside), !improvement->steps.empty(), improvement->values_wrong);
  if (found.Leave(Leaves::kMeans))
    DoubtBesideRest(MostBesideRest(explained_share, found.Leave(Leaves::kDoubts)), &improvement->steps,
                    &improvement->candidates);
  if (improvement->changed && !improvement->improved.name.empty()) improvement->improved.name += "_better";
}

}  // namespace touchstone::diagnosis::engine
