#include "server/diagnosis/engine/competition/effect_explanation.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/normal.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"
#include "server/diagnosis/engine/search/resemblance.h"

namespace touchstone::diagnosis::engine {
namespace {

// The extension that stands for an effect: on all objects alike, else the most probable one.
const Extension* Find(const std::vector<Extension>& extensions, const std::string& effect) {
  const Extension* found = nullptr;
  for (const Extension& extension : extensions) {
    if (extension.name != effect || extension.nameless) continue;
    if (!extension.rare && extension.object.empty()) return &extension;
    if (found == nullptr || extension.log_evidence > found->log_evidence) found = &extension;
  }
  return found;
}

absl::Status NotAmong(const std::vector<Extension>& extensions, const std::string& effect) {
  std::vector<std::string> names;
  for (const Extension& extension : extensions)
    if (!extension.nameless && std::find(names.begin(), names.end(), extension.name) == names.end())
      names.push_back(extension.name);
  return absl::NotFoundError(
      absl::StrCat("'", effect, "' is no effect that changes what is expected of these measurements; one of ",
                   absl::StrJoin(names, ", "), " was expected"));
}

// Of values that a bound holds where they change nothing: the size beyond which the likelihood falls by more than a 95 %
// interval allows, to first order. The interval that Describe gives has no width there.
void SetLimits(const Experiment& experiment, const Fit& fit, std::vector<ParameterEstimate>* values) {
  const Eigen::MatrixXd gram = experiment.likelihood->Gram(fit.columns, fit.hypothesis);
  const int index = fit.model.parameters().back().effect;
  const std::vector<model::ParameterInfo>& parameters = fit.model.base().effects[index].effect->parameters;
  for (int i = 0; i < fit.model.size(); ++i) {
    const FreeParameter& p = fit.model.parameters()[i];
    const bool at_lower = fit.point[i] <= p.lower, at_upper = fit.point[i] >= p.upper;
    const double information = gram(1 + i, 1 + i);
    if (p.effect != index || p.reciprocal || at_lower == at_upper || !(information > 0)) continue;
    const double sign = at_lower ? 1 : -1;
    const double best = sign * gram(0, 1 + i) / information, error = fit.sigma / std::sqrt(information);
    const double size = best + std::sqrt(best * best + std::pow(kNormalQuantile975 * error, 2));
    const model::ParameterInfo& info = parameters[p.parameter];
    if (info.arity != model::Arity::kScalar) continue;
    for (ParameterEstimate& value : *values) {
      if (value.name != info.name || value.object != p.object) continue;
      double& end = at_lower ? value.upper : value.lower;
      end = std::clamp(value.value + sign * FromSi(info.unit, size), info.lower, info.upper);
    }
  }
}

absl::StatusOr<std::vector<TakenOver>> FindTakenOver(const StepwiseSearch& search, const Fit& initial,
                                                     const std::vector<Extension>& extensions,
                                                     const EffectExplanation& explained) {
  const Experiment& experiment = search.experiment();
  const Eigen::VectorXd response =
      experiment.observations->Change(initial.predicted, explained.fit->predicted);
  std::vector<TakenOver> taken;
  if (!(response.norm() > 0)) return taken;
  for (const Extension& extension : extensions) {
    if (!extension.Acts() || extension.rare || extension.nameless || !extension.object.empty() ||
        extension.name == explained.effect)
      continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd columns,
                                ResponseColumns(experiment, extension, initial));
    const double share = ShareExplained(columns, response);
    const double gain_nats = extension.log_evidence - initial.log_evidence;
    // What gains nothing would have to act the other way.
    if (share < kCompetitionRules.worth_naming_share || !(gain_nats > 0)) continue;
    const std::string name =
        extension.candidate < 0 ? absl::StrCat(kGivenPrefix, extension.name) : extension.name;
    const auto same =
        std::find_if(taken.begin(), taken.end(), [&](const TakenOver& t) { return t.effect == name; });
    if (same == taken.end())
      taken.push_back({name, share, gain_nats});
    else if (share > same->share)  // with a value per object
      same->share = share, same->gain_nats = gain_nats;
  }
  std::stable_sort(taken.begin(), taken.end(),
                   [](const TakenOver& a, const TakenOver& b) { return a.share > b.share; });
  if (taken.size() > kCompetitionRules.max_taken_over) taken.resize(kCompetitionRules.max_taken_over);
  return taken;
}

}  // namespace

absl::StatusOr<EffectExplanation> ExplainEffect(const StepwiseSearch& search, const Fit& initial,
                                                int initial_effects, const std::string& effect) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Extension> extensions,
                              search.Score(initial, initial_effects));
  const Extension* extension = Find(extensions, effect);
  if (extension == nullptr) return NotAmong(extensions, effect);
  EffectExplanation explained;
  explained.effect = effect;
  explained.in_model = extension->candidate < 0;
  explained.needed_nats = extension->rare ? search.rules().enter_rare_nats : search.rules().enter_nats;
  explained.visible = extension->Acts();
  if (!explained.visible) return explained;
  TOUCHSTONE_ASSIGN_OR_RETURN(explained.fit, search.FitExtension(*extension));
  const Fit& fit = *explained.fit;
  const int index = fit.model.parameters().back().effect;
  explained.changes = !ChangesNothing(fit, index);
  explained.gain_nats = fit.log_evidence - initial.log_evidence;
  explained.parameters = fit.model.Describe(index, fit.point, fit.covariance);
  SetLimits(search.experiment(), fit, &explained.parameters);
  // That nothing is missing, each other candidate, and this one as it was fitted.
  std::vector<double> all = {0, explained.gain_nats};
  for (const Extension& other : extensions)
    if (other.Acts() && other.name != effect) all.push_back(other.log_evidence - initial.log_evidence);
  explained.probability = explained.changes ? ProbabilityAmong({explained.gain_nats}, all) : 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(explained.taken_over, FindTakenOver(search, initial, extensions, explained));
  return explained;
}

}  // namespace touchstone::diagnosis::engine
