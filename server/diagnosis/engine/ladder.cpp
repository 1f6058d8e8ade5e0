#include "server/diagnosis/engine/ladder.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/engine/where_in_words.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kZeroErrors = 2;       // standard errors of a value that may be zero
constexpr double kZero = 1e-6;          // ... or this share of the typical size
constexpr double kDoubted = 0.5;        // probability of a step that explains nothing of what is left
constexpr double kMaxBesideRest = 0.9;  // ... of one that explains all but a trace

// The model with only those of its further effects that are in `kept`.
Parameterization Only(const Parameterization& model, int initial_effects, const std::vector<int>& kept) {
  Parameterization part = model;
  for (int index = static_cast<int>(model.base().effects.size()) - 1; index >= initial_effects; --index)
    if (std::find(kept.begin(), kept.end(), index) == kept.end()) part = part.Without(index);
  return part;
}

bool IsZero(const model::Effect& effect, const std::vector<ParameterEstimate>& estimates) {
  for (const ParameterEstimate& e : estimates)
    for (const model::ParameterInfo& parameter : effect.parameters)
      if (parameter.name == e.name &&
          (parameter.reciprocal || std::abs(e.value - parameter.neutral) >
                                       std::max(kZeroErrors * e.std_error, kZero * parameter.typical)))
        return false;
  return true;
}

// Whether a step may come before the others that are open.
bool IsNext(const SelectedStep& step, const std::vector<const SelectedStep*>& open,
            const std::vector<int>& at_end) {
  const auto place = [&](const SelectedStep& of) {
    const auto found = std::find(at_end.begin(), at_end.end(), of.effect);
    return found == at_end.end() ? -1 : found - at_end.begin();
  };
  return std::all_of(open.begin(), open.end(),
                     [&](const SelectedStep* other) { return place(step) <= place(*other); });
}

}  // namespace

absl::StatusOr<std::vector<OrderedStep>> OrderSteps(const Experiment& experiment, const Explanation& whole,
                                                    int nameless, const std::vector<SelectedStep>& steps,
                                                    const std::vector<int>& at_end) {
  std::vector<OrderedStep> ordered;
  std::vector<const SelectedStep*> open;
  for (const SelectedStep& step : steps) open.push_back(&step);
  std::vector<int> kept;
  while (!open.empty()) {
    OrderedStep next;
    size_t chosen = 0;
    const bool last = open.size() == 1 && nameless < 0;
    for (size_t j = 0; j < open.size(); ++j) {
      if (!IsNext(*open[j], open, at_end)) continue;
      std::vector<int> with = kept;
      with.push_back(open[j]->effect);
      absl::StatusOr<Fit> trial =
          last ? whole.fit : FitModel(experiment, Only(whole.fit.model, whole.initial_effects, with));
      TOUCHSTONE_RETURN_IF_ERROR(trial.status());
      if (next.step != nullptr && trial->log_evidence <= next.fit.log_evidence) continue;
      next = {open[j], *std::move(trial), last};
      chosen = j;
    }
    kept.push_back(next.step->effect);
    open.erase(open.begin() + static_cast<long>(chosen));
    ordered.push_back(std::move(next));
  }
  return ordered;
}

int StepWithoutGain(const Quality& before, const std::vector<Quality>& after) {
  const Quality* last = &before;
  for (size_t j = 0; j < after.size(); ++j) {
    if (!(after[j].rmse < last->rmse && after[j].heldout_rmse < last->heldout_rmse))
      return static_cast<int>(j);
    last = &after[j];
  }
  return -1;
}

bool StepsAtEnd::MoveToEnd(int effect, const std::vector<int>& climbed) {
  if (climbed.back() == effect || std::find(effects_.begin(), effects_.end(), effect) != effects_.end())
    return false;
  effects_.push_back(effect);
  return true;
}

void StepsAtEnd::TakeOut(int effect) {
  effects_.erase(std::remove(effects_.begin(), effects_.end(), effect), effects_.end());
  for (int& other : effects_) other -= other > effect;
}

std::vector<Quality> QualitiesOf(const std::vector<LadderStep>& steps) {
  std::vector<Quality> qualities;
  for (const LadderStep& step : steps) qualities.push_back(step.quality);
  return qualities;
}

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

void AddConfounded(const LadderStep& step, std::vector<ConfoundedEffects>* confounded) {
  if (step.equivalent.empty()) return;
  std::vector<std::string> names = {step.effect};
  names.insert(names.end(), step.equivalent.begin(), step.equivalent.end());
  confounded->push_back({std::move(names), step.discriminating_measurement});
}

absl::StatusOr<GivenEffects> DescribeGivenEffects(const Experiment& experiment, const Fit& selected,
                                                  const Fit& values, const Eigen::MatrixXd& covariance,
                                                  const model::Model& given,
                                                  const std::vector<std::string>& objects) {
  const Parameterization initial(given, objects);
  GivenEffects found;
  for (int index = static_cast<int>(given.effects.size()) - 1; index >= 0; --index) {
    if (!values.model.IsFree(index)) continue;
    const model::Effect& effect = *given.effects[index].effect;
    RefittedEffect refit = {NameOf(effect), values.model.Describe(index, values.point, covariance)};
    if (IsZero(effect, refit.parameters)) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const Fit without, FitModel(experiment, selected.model.Without(index)));
      if (without.log_evidence >= selected.log_evidence) {
        found.superfluous.push_back(index);
        found.superfluous_names.push_back(refit.effect);
        continue;
      }
    }
    const std::vector<ParameterEstimate> old = initial.Describe(index, Eigen::VectorXd(), Eigen::MatrixXd());
    for (size_t j = 0; j < refit.parameters.size() && j < old.size(); ++j)
      refit.parameters[j].before = old[j].value;
    found.refitted.insert(found.refitted.begin(), std::move(refit));
  }
  return found;
}

double ExplainedShare(double rmse_before, double rmse_after, double noise) {
  const double before = rmse_before * rmse_before - noise * noise;
  const double after = rmse_after * rmse_after - noise * noise;
  return before > 0 ? std::clamp(1 - after / before, 0.0, 1.0) : 0;
}

double MostBesideRest(double explained_share, bool doubted) {
  return doubted ? kDoubted : kDoubted + (kMaxBesideRest - kDoubted) * explained_share;
}

void DoubtBesideRest(double most, std::vector<LadderStep>* steps, std::vector<RankedCandidate>* candidates) {
  for (LadderStep& step : *steps) {
    step.probability = std::min(step.probability, most);
    AddWords("Beside it a rest remains unexplained: it may stand in for something else.", &step);
  }
  for (RankedCandidate& candidate : *candidates)
    candidate.probability = std::min(candidate.probability, most);
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
