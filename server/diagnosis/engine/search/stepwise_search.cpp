#include "server/diagnosis/engine/search/stepwise_search.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/numbers/distributions.h"
#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/engine/search/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

std::string InWords(const Extension& extension) {
  return extension.object.empty() ? extension.name : absl::StrCat(extension.name, " on ", extension.object);
}

// Whether each group with values of its own has so many rows for each of them.
bool HaveRowsForOwnValues(const ObservationModel& observations, const Parameterization& model,
                          int min_rows_per_parameter) {
  for (int group = 0; group < static_cast<int>(observations.groups().size()); ++group) {
    const auto own =
        std::count_if(model.parameters().begin(), model.parameters().end(),
                      [&](const FreeParameter& p) { return p.object == observations.groups()[group]; });
    const int rows = observations.FirstRowOfGroup(group + 1) - observations.FirstRowOfGroup(group);
    if (own > 0 && rows < min_rows_per_parameter * (own + 1)) return false;
  }
  return true;
}

}  // namespace

bool StepwiseSearch::IsLikely(const Fit& before, const Tried& tried) const {
  const Fit& after = tried.fit;
  // So few numbers are followed by anything.
  if (experiment_.observations->rows() < rules_.min_rows_per_parameter * (after.model.size() + 1) ||
      (tried.rare &&
       !HaveRowsForOwnValues(*experiment_.observations, after.model, rules_.min_rows_per_parameter)))
    return false;
  if (after.log_evidence - before.log_evidence < EnterNats(tried.rare)) return false;
  const double ratio = 2 * (after.log_likelihood - before.log_likelihood);
  const int added = std::max(after.model.size() - before.model.size(), 1);
  return static_cast<double>(tried.tried) * ChiSquaredTail(ratio, added) <= rules_.family_wise_p;
}

absl::StatusOr<bool> StepwiseSearch::FallsHeldOut(const Fit& before, const Fit& after, bool rare) const {
  if (rules_.min_cv_gain_std_errors > 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> had, HeldOutSquaresRefitted(experiment_, before));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> has, HeldOutSquaresRefitted(experiment_, after));
    const HeldOutFall fall =
        FallOfHeldOut(had, has, kCandidateRules.negligible_share * after.sigma * after.sigma);
    if (!(fall.mean > rules_.min_cv_gain_std_errors * fall.std_error)) return false;
  }
  // Values of single objects cannot be predicted from other objects.
  const auto unseen = rare ? HeldOutRmseByBlock : HeldOutRmse;
  const double had = unseen(experiment_, before), has = unseen(experiment_, after);
  const bool far = rules_.rest_cv_gain > 0 && before.sigma > rules_.rest_sigma;
  const double kept = 1 - (far ? rules_.rest_cv_gain : rules_.min_relative_cv_gain);
  if (!rules_.cv_gain_over_noise) return has < kept * had;
  return had * had - has * has > (1 - kept * kept) * before.sigma * before.sigma;
}

absl::StatusOr<Fit> StepwiseSearch::FitExtension(const Extension& extension, const Fit* from) const {
  std::vector<Parameterization> starts = {extension.start};
  const model::Effect* effect =
      extension.candidate >= 0 ? candidates_[extension.candidate].effect.get() : nullptr;
  const int size = extension.start.size();
  if (extension.acts_at) starts.push_back(*extension.acts_at);
  if (effect != nullptr && effect->formula != nullptr && candidates_[extension.candidate].of_user) {
    // Nothing is known of a user's formula: starts all over its bounds.
    for (int k = 0; k < kCandidateRules.formula_starts; ++k) {
      Eigen::VectorXd point = extension.start.Start();
      RandomStream random(k, RandomDomain::kDiagnosis, 77);
      for (int i = 0; i < size; ++i) {
        const FreeParameter& c = extension.start.parameters()[i];
        if (c.effect == static_cast<int>(extension.start.base().effects.size()) - 1)
          point[i] = random.Uniform(c.lower, c.upper);
      }
      starts.push_back(extension.start);
      starts.back().MoveTo(point);
    }
  }
  absl::StatusOr<Fit> best = absl::InternalError("no fit");
  for (Parameterization& start : starts) {
    absl::StatusOr<Fit> fit = FitModel(experiment_, std::move(start), kFitRules.max_iterations, from);
    if (!fit.ok() && fit.status().code() == absl::StatusCode::kCancelled) return fit;
    if (fit.ok() && (!best.ok() || fit->log_evidence > best->log_evidence)) best = std::move(fit);
    if (!best.ok() && !fit.ok()) best = fit.status();
  }
  return best;
}

absl::StatusOr<std::vector<StepwiseSearch::Tried>> StepwiseSearch::LikelyExtensions(
    const Fit& from, std::vector<Extension> extensions) const {
  std::sort(extensions.begin(), extensions.end(),
            [](const Extension& a, const Extension& b) { return a.log_evidence > b.log_evidence; });
  std::vector<Tried> likely;
  int fitted = 0, fitted_rare = 0;
  size_t rare = 0;
  for (const Extension& extension : extensions) rare += extension.rare;
  for (const Extension& extension : extensions) {
    const bool unreached = extension.acts_at.has_value();
    const bool user = extension.candidate >= 0 && candidates_[extension.candidate].of_user;
    const bool near =
        extension.visible &&
        (extension.rare ? fitted_rare < rules_.max_rare_refits : fitted < rules_.max_refits) &&
        extension.log_evidence > extensions[0].log_evidence - kCandidateRules.near_prediction_nats &&
        extension.log_evidence > from.log_evidence;
    if (!near && (extension.rare || (!unreached && !user))) continue;
    progress_(absl::StrCat("fitting ", InWords(extension)));
    (extension.rare ? fitted_rare : fitted) += near;
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit, FitExtension(extension, &from));
    Tried tried = {std::move(fit), extension.rare ? rare : extensions.size() - rare, extension.rare};
    if (IsLikely(from, tried)) likely.push_back(std::move(tried));
  }
  std::stable_sort(likely.begin(), likely.end(),
                   [](const Tried& a, const Tried& b) { return a.fit.log_evidence > b.fit.log_evidence; });
  return likely;
}

absl::StatusOr<bool> StepwiseSearch::AddStep(Explanation* explanation) const {
  std::vector<PairOfExtensions> pairs;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Extension> extensions,
                              Score(explanation->fit, explanation->initial_effects, &pairs));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Tried> likely, LikelyExtensions(explanation->fit, extensions));
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool one, AddOne(std::move(likely), explanation));
  return one ? true : AddTwo(extensions, pairs, explanation);
}

absl::StatusOr<bool> StepwiseSearch::AddOne(std::vector<Tried> likely, Explanation* explanation) const {
  bool rare = false;
  for (int step = 0; !likely.empty(); ++step) {
    // The best may stand in for what is missing and fail where it was not fitted; the next need not.
    for (Tried& tried : likely) {
      TOUCHSTONE_ASSIGN_OR_RETURN(bool falls, FallsHeldOut(explanation->fit, tried.fit, rare || tried.rare));
      if (step > 0)
        falls &=
            std::pow(HeldOutRmseByBlock(experiment_, tried.fit), 2) <
            (1 - rules_.min_trial_cv_gain) * std::pow(HeldOutRmseByBlock(experiment_, explanation->fit), 2);
      if (!falls) continue;
      explanation->fit = std::move(tried.fit);
      return true;
    }
    if (step == rules_.max_trial_steps) break;
    const Fit trial = std::move(likely[0].fit);
    rare |= likely[0].rare;
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Extension> next, Score(trial, explanation->initial_effects));
    TOUCHSTONE_ASSIGN_OR_RETURN(likely, LikelyExtensions(trial, std::move(next)));
  }
  return false;
}

absl::StatusOr<bool> StepwiseSearch::AddTwo(const std::vector<Extension>& extensions,
                                            const std::vector<PairOfExtensions>& pairs,
                                            Explanation* explanation) const {
  const Fit& from = explanation->fit;
  std::optional<Tried> best;
  for (size_t k = 0; k < pairs.size() && k < kCandidateRules.max_pairs; ++k) {
    if (pairs[k].log_evidence < from.log_evidence + 2 * rules_.enter_nats) break;
    const Extension& second = extensions[pairs[k].second];
    progress_(absl::StrCat("fitting ", InWords(extensions[pairs[k].first]), " and ", InWords(second)));
    Parameterization both = extensions[pairs[k].first].start;
    Extend(second, &both);
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit,
                                FitModel(experiment_, std::move(both), kFitRules.max_iterations, &from));
    if (!best || fit.log_evidence > best->fit.log_evidence) best = {std::move(fit), pairs.size(), false};
  }
  if (!best || best->fit.log_evidence < from.log_evidence + 2 * rules_.enter_nats || !IsLikely(from, *best))
    return false;
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool falls, FallsHeldOut(from, best->fit, false));
  if (falls) explanation->fit = std::move(best->fit);
  return falls;
}

absl::StatusOr<Fit> StepwiseSearch::WithoutEffect(const Explanation& explanation, int index) const {
  // Other effects of the given model stay as free as they are.
  return FitModel(experiment_, explanation.fit.model.Without(index));
}

absl::StatusOr<bool> StepwiseSearch::RemoveStep(Explanation* explanation) const {
  for (int index = static_cast<int>(explanation->fit.model.base().effects.size()) - 1;
       index >= explanation->initial_effects; --index) {
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit, WithoutEffect(*explanation, index));
    const model::EffectInstance& instance = explanation->fit.model.base().effects[index];
    const bool rare = !explanation->fit.model.OnlyObject(index).empty() ||
                      (instance.per_object && !instance.effect->often_per_object);
    if (explanation->fit.log_evidence - fit.log_evidence >= EnterNats(rare)) continue;
    explanation->fit = std::move(fit);
    return true;
  }
  return false;
}

absl::StatusOr<std::vector<CompetingFit>> StepwiseSearch::CompetingFits(const Explanation& explanation,
                                                                        int index) const {
  const model::Effect& own = *explanation.fit.model.base().effects[index].effect;
  const std::string own_object = explanation.fit.model.OnlyObject(index);
  const bool own_per_object = explanation.fit.model.base().effects[index].per_object;
  // The other effects stay where they are: what takes this one's place finds them so.
  TOUCHSTONE_ASSIGN_OR_RETURN(const Fit without,
                              FitModel(experiment_, explanation.fit.model.Without(index), 0));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Extension> extensions, Score(without, explanation.initial_effects));
  std::sort(extensions.begin(), extensions.end(),
            [](const Extension& a, const Extension& b) { return a.log_evidence > b.log_evidence; });
  std::vector<CompetingFit> competing;
  competing.push_back({NameOf(own), own_per_object, own_object, false, explanation.fit});
  // The linearised prediction is good to about a share of what there is to explain.
  const double gain_nats = explanation.fit.log_evidence - without.log_evidence;
  const double near = std::max(kCandidateRules.near_prediction_nats.value(),
                               kCandidateRules.poor_prediction_share * gain_nats);
  int fitted = 0, fitted_rare = 0;
  for (const Extension& extension : extensions) {
    // A value of the model that is set free competes like any effect.
    const bool given = extension.candidate < 0;
    const bool per_object = !given && candidates_[extension.candidate].per_object;
    if (!extension.Acts()) continue;
    if (extension.name == NameOf(own) && extension.object == own_object && per_object == own_per_object)
      continue;
    const bool likely =
        (extension.rare ? fitted_rare < rules_.max_rare_refits : fitted < rules_.max_refits) &&
        extension.log_evidence > explanation.fit.log_evidence - near;
    // What is known to resemble this effect, and acts where it does, is tried whatever the prediction says.
    const bool alike =
        given || (extension.object == own_object && (!extension.rare || per_object == own_per_object));
    const bool declared =
        alike && IsDeclaredConfounded(own, extension.name) &&
        extension.log_evidence - without.log_evidence >= rules_.min_declared_share * gain_nats;
    if (!likely && !declared) continue;
    progress_(absl::StrCat("trying ", InWords(extension), " instead of ", NameOf(own)));
    (extension.rare ? fitted_rare : fitted) += likely;
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit fit, FitExtension(extension, &without));
    competing.push_back({given ? absl::StrCat(kGivenPrefix, extension.name) : extension.name, per_object,
                         extension.object, extension.nameless, std::move(fit)});
  }
  std::sort(competing.begin() + 1, competing.end(), [](const CompetingFit& a, const CompetingFit& b) {
    return a.fit.log_evidence > b.fit.log_evidence;
  });
  return competing;
}

absl::StatusOr<bool> StepwiseSearch::SwapStep(Explanation* explanation) const {
  for (int index = explanation->initial_effects;
       index < static_cast<int>(explanation->fit.model.base().effects.size()); ++index) {
    const model::Effect& effect = *explanation->fit.model.base().effects[index].effect;
    if (effect.formula != nullptr || effect.lookup != nullptr) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<CompetingFit> competing, CompetingFits(*explanation, index));
    if (competing.size() < 2) continue;
    const bool larger = competing[1].fit.model.size() > explanation->fit.model.size();
    if (competing[1].fit.log_evidence <=
        explanation->fit.log_evidence + (larger ? rules_.swap_nats : kCandidateRules.swap_equal_nats.value()))
      continue;
    explanation->fit = std::move(competing[1].fit);
    return true;
  }
  return false;
}

absl::StatusOr<Explanation> StepwiseSearch::Run(Parameterization start, int initial_effects) const {
  Explanation explanation;
  explanation.initial_effects = initial_effects;
  TOUCHSTONE_ASSIGN_OR_RETURN(explanation.fit, FitModel(experiment_, std::move(start)));
  for (int step = 0; step < rules_.max_steps; ++step) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool added, AddStep(&explanation));
    if (!added) break;
    // Two true effects together may have let in a third that mixes them.
    if (explanation.fit.model.base().effects.size() < 2) continue;
    TOUCHSTONE_RETURN_IF_ERROR(Improve(&explanation));
  }
  return explanation;
}

absl::Status StepwiseSearch::Improve(Explanation* explanation) const {
  for (int tries = 0; tries < 3; ++tries) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool swapped, SwapStep(explanation));
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool removed, RemoveStep(explanation));
    if (!swapped && !removed) break;
  }
  return absl::OkStatus();
}

absl::StatusOr<Explanation> StepwiseSearch::Continue(Explanation explanation) const {
  const int initial_effects = explanation.initial_effects;
  TOUCHSTONE_ASSIGN_OR_RETURN(explanation.fit, FitModel(experiment_, explanation.fit.model));
  const auto has_steps = [&] {
    return static_cast<int>(explanation.fit.model.base().effects.size()) > initial_effects;
  };
  if (has_steps()) TOUCHSTONE_RETURN_IF_ERROR(Improve(&explanation));
  for (int step = 0; step < rules_.max_steps; ++step) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool added, AddStep(&explanation));
    if (!added) break;
    TOUCHSTONE_RETURN_IF_ERROR(Improve(&explanation));
  }
  return explanation;
}

}  // namespace touchstone::diagnosis::engine
