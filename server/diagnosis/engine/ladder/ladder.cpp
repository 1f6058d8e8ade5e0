#include "server/diagnosis/engine/ladder/ladder.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/status.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/ladder/rules.h"
#include "server/diagnosis/engine/ladder/where_in_words.h"

namespace touchstone::diagnosis::engine {
namespace {

bool IsZero(const model::Effect& effect, const std::vector<ParameterEstimate>& estimates) {
  for (const ParameterEstimate& e : estimates)
    for (const model::ParameterInfo& parameter : effect.parameters)
      if (parameter.name == e.name &&
          (parameter.reciprocal || std::abs(e.value - parameter.neutral) >
                                       std::max(kLadderRules.zero_errors * e.std_error,
                                                kCompetitionRules.value_tolerance * parameter.typical)))
        return false;
  return true;
}

// Everything but the error and the model.
LadderStep DescribeStep(const Fit& values, const Eigen::MatrixXd& covariance, const SelectedStep& from) {
  const model::EffectInstance& instance = values.model.base().effects[from.effect];
  LadderStep step;
  step.effect = NameOf(*instance.effect);
  step.scope = instance.per_object ? EffectScope::kObject : EffectScope::kRig;
  AddTexts(*instance.effect, &step);
  step.probability = from.probability;
  step.gain_nats = from.gain_nats;
  step.parameters = values.model.Describe(from.effect, values.point, covariance);
  if (const std::string where = WhereInWords(values, from); !where.empty()) AddWords(where, &step);
  if (!from.words.empty()) AddWords(from.words, &step);
  std::vector<std::string> names = {step.effect};
  for (const CompetingEffect& other : from.competing)
    if (other.equivalent && std::find(names.begin(), names.end(), other.name) == names.end())
      names.push_back(other.name);
  step.equivalent.assign(names.begin() + 1, names.end());
  for (const CompetingEffect& other : from.competing)
    if (other.stopped && other.per_object == instance.per_object &&
        other.object == values.model.OnlyObject(from.effect))
      AddWords(other.name + " would do as well with a value beyond its bound.", &step);
  if (!step.equivalent.empty()) step.discriminating_measurement = DiscriminatingMeasurement(names);
  return step;
}

}  // namespace

absl::StatusOr<std::vector<int>> ImproveValues(const Experiment& experiment, const Fit& selected,
                                               const Fit& values, const Eigen::MatrixXd& covariance,
                                               const model::Model& given,
                                               const std::vector<std::string>& objects,
                                               Improvement* improvement) {
  improvement->improved = values.model.base();
  RoundValues(values, &improvement->improved);
  const Parameterization initial(given, objects);
  std::vector<int> superfluous;
  for (int index = static_cast<int>(given.effects.size()) - 1; index >= 0; --index) {
    if (!values.model.IsFree(index)) continue;
    improvement->values_wrong = improvement->changed = true;
    const model::Effect& effect = *given.effects[index].effect;
    RefittedEffect refit = {NameOf(effect), values.model.Describe(index, values.point, covariance)};
    if (IsZero(effect, refit.parameters)) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const Fit without, FitModel(experiment, selected.model.Without(index)));
      if (without.log_evidence >= selected.log_evidence) {
        improvement->improved.effects.erase(improvement->improved.effects.begin() + index);
        superfluous.push_back(index);
        improvement->superfluous.push_back(refit.effect);
        continue;
      }
    }
    const std::vector<ParameterEstimate> old = initial.Describe(index, Eigen::VectorXd(), Eigen::MatrixXd());
    for (size_t j = 0; j < refit.parameters.size() && j < old.size(); ++j)
      refit.parameters[j].before = old[j].value;
    improvement->refitted.insert(improvement->refitted.begin(), std::move(refit));
  }
  return superfluous;
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

namespace {

// A candidate alone that is no part of the explanation is at most as probable as what that leaves.
void DoubtOthers(Improvement* improvement) {
  if (improvement->steps.empty()) return;
  const double explained = improvement->steps[0].probability;
  if (explained >= 1) return;  // not assessed
  for (RankedCandidate& candidate : improvement->candidates) {
    const bool is_part = std::any_of(
        improvement->steps.begin(), improvement->steps.end(), [&candidate](const LadderStep& step) {
          return step.effect == candidate.effect ||
                 std::count(step.equivalent.begin(), step.equivalent.end(), candidate.effect) > 0;
        });
    if (!is_part) candidate.probability = std::min(candidate.probability, 1 - explained);
  }
}

}  // namespace

void Conclude(const Hypotheses& found, double explained_share, Improvement* improvement) {
  improvement->verdict =
      VerdictOf(found.Leave(Leaves::kBeside), !improvement->steps.empty(), improvement->values_wrong);
  if (improvement->changed && !improvement->improved.name.empty()) improvement->improved.name += "_better";
  DoubtOthers(improvement);
  if (!found.Leave(Leaves::kMeans)) return;
  const double doubted = kLadderRules.doubted;
  const double most = found.Leave(Leaves::kDoubts)
                          ? doubted
                          : doubted + (kLadderRules.max_beside_rest - doubted) * explained_share;
  for (LadderStep& step : improvement->steps) {
    step.probability = std::min(step.probability, most);
    AddWords("Beside it a rest remains unexplained: it may stand in for something else.", &step);
  }
  for (RankedCandidate& candidate : improvement->candidates)
    candidate.probability = std::min(candidate.probability, most);
}

void AddConfounded(const LadderStep& step, std::vector<ConfoundedEffects>* confounded) {
  if (step.equivalent.empty()) return;
  std::vector<std::string> names = {step.effect};
  names.insert(names.end(), step.equivalent.begin(), step.equivalent.end());
  confounded->push_back({std::move(names), step.discriminating_measurement});
}

double ExplainedShare(double rmse_before, double rmse_after, double noise) {
  const double before = rmse_before * rmse_before - noise * noise;
  const double after = rmse_after * rmse_after - noise * noise;
  return before > 0 ? std::clamp(1 - after / before, 0.0, 1.0) : 0;
}

void AddWords(const std::string& words, LadderStep* step) {
  absl::StrAppend(&step->words, step->words.empty() ? "" : " ", words);
}

void AddTexts(const model::Effect& effect, LadderStep* step) {
  step->meaning = effect.meaning;
  step->check_on_rig = effect.check_on_rig;
  step->remedy = effect.remedy;
}

std::string EffectYaml(model::Model model, model::EffectInstance instance) {
  model.effects = {std::move(instance)};
  const std::string text = model::FormatModel(model);
  const size_t at = text.find("effects:");
  const size_t line = at == std::string::npos ? std::string::npos : text.find('\n', at);
  return line == std::string::npos ? text : text.substr(line + 1);
}

}  // namespace touchstone::diagnosis::engine
