#include "server/diagnosis/selection/selection.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/diagnosis/engine/effect_columns.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/diagnosis/selection/curve_competition.h"
#include "server/diagnosis/selection/curves/suggested_rest.h"
#include "server/diagnosis/selection/group_difference.h"
#include "server/diagnosis/selection/revised_touches.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"
#include "server/diagnosis/selection/touches_nothing_missing.h"
#include "server/diagnosis/selection/unsupported_steps.h"
#include "server/diagnosis/touches/noise/noise_sample.h"

namespace touchstone::diagnosis::selection {
namespace {

// The best fit with one more term of the dictionary, if it is worth its complexity.
struct WithTerm {
  bool found = false;
  FormulaTerm term;
  engine::Explanation explanation;
  // Of the best term, found or not: log evidence less the price of its complexity, over the rival's.
  engine::NamelessRival nearest = {-INFINITY, ""};
};

// The index of the formula of this name among the effects that were added; -1: there is none.
int FindFormula(const engine::Fit& fit, int initial_effects, const std::string& name) {
  for (int index = initial_effects; index < static_cast<int>(fit.model.base().effects.size()); ++index) {
    const model::Effect& effect = *fit.model.base().effects[index].effect;
    if (effect.formula != nullptr && effect.formula->name == name) return index;
  }
  return -1;
}

// `rival`: the fit that it must be better than, beside `without` or in the place of what that lacks.
absl::StatusOr<WithTerm> TryTerms(const Workspace& workspace, const engine::StepwiseSearch& search,
                                  const engine::Explanation& without, const FormulaTerm* first,
                                  const engine::Fit& rival) {
  const engine::Experiment& experiment = workspace.experiment;
  WithTerm best;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.searched_predictor->Run(without.fit.model.base(), true, true));
  const std::vector<FormulaTerm> terms = ScoreTerms(experiment, *workspace.rows, without.fit, details);
  const double penalty_nats = search.rules().complexity_penalty_nats;
  double best_evidence = rival.log_evidence + search.rules().enter_nats + penalty_nats;
  int fitted = 0;
  for (const FormulaTerm& candidate : terms) {
    if (fitted++ == kSelectionRules.terms_fitted || candidate.gain_nats < 0.5 * penalty_nats) break;
    FormulaTerm term = candidate;
    engine::Parameterization base = without.fit.model;
    if (first != nullptr) {
      // The second term joins the first in one expression.
      term = Sum(*first, candidate);
      const int at = FindFormula(without.fit, without.initial_effects, NameOfRest(first->covariate));
      if (at >= 0) base = base.Without(at);
      term.covariate = first->covariate;
    }
    const auto effect = MakeTermEffect(NameOfRest(term.covariate), term);
    if (!effect.ok()) return effect.status();
    engine::Parameterization start = base;
    start.Add(*effect, false);
    absl::StatusOr<engine::Fit> fit = engine::FitModel(experiment, std::move(start));
    if (!fit.ok() && fit.status().code() == absl::StatusCode::kCancelled) return fit.status();
    if (!fit.ok()) continue;
    if (const double ahead_nats = fit->log_evidence - penalty_nats - rival.log_evidence;
        ahead_nats > best.nearest.ahead_nats)
      best.nearest = {ahead_nats,
                      absl::StrCat("A formula would say nearly the same: ", term.expression, ".")};
    if (fit->log_evidence <= best_evidence) continue;
    const double gain = 1 - engine::HeldOutRmse(experiment, *fit) / engine::HeldOutRmse(experiment, rival);
    if (gain < search.rules().min_relative_cv_gain) continue;
    best_evidence = fit->log_evidence;
    best.found = true;
    best.term = term;
    best.explanation.fit = *std::move(fit);
    best.explanation.initial_effects = without.initial_effects;
  }
  return best;
}

// The same in the place of all effects that were found, and of each: what has no name may look like what has one. Notes how near
// a term comes to each.
absl::StatusOr<WithTerm> TryTermsInPlaceOfEffects(const Workspace& workspace,
                                                  const engine::Explanation& found, SelectionResult* result) {
  const std::vector<model::EffectInstance>& effects = found.fit.model.base().effects;
  std::vector<std::vector<int>> places;  // from the last to the first
  for (int index = static_cast<int>(effects.size()) - 1; index >= found.initial_effects; --index)
    places.push_back({index});
  if (places.size() > 1) {
    std::vector<int> all;
    for (const std::vector<int>& place : places) all.push_back(place[0]);
    places.insert(places.begin(), all);
  }
  WithTerm best;
  for (const std::vector<int>& place : places) {
    engine::Parameterization rest = found.fit.model;
    for (const int index : place) rest = rest.Without(index);
    engine::Explanation without;
    without.initial_effects = found.initial_effects;
    TOUCHSTONE_ASSIGN_OR_RETURN(without.fit, engine::FitModel(workspace.experiment, std::move(rest)));
    TOUCHSTONE_ASSIGN_OR_RETURN(WithTerm with,
                                TryTerms(workspace, *result->search, without, nullptr, found.fit));
    for (const int index : place) NoteRival(engine::NameOf(*effects[index].effect), with.nearest, result);
    if (with.found && (!best.found || with.explanation.fit.log_evidence > best.explanation.fit.log_evidence))
      best = std::move(with);
  }
  return best;
}

// Effects of the catalogue first; what they leave may follow a formula; with the formula in place some of the
// effects may turn out to have stood in for it.
// `before`: what was found with other touches, or other weights; it goes on from there too.
absl::Status FindCauses(const Workspace& workspace, const std::optional<engine::Parameterization>& before,
                        SelectionResult* result) {
  const engine::StepwiseSearch& search = *result->search;
  const int initial_effects = static_cast<int>(workspace.input.model->effects.size());
  result->initial_effects = initial_effects;
  engine::Parameterization base(*workspace.input.model, workspace.searched->objects);
  TOUCHSTONE_ASSIGN_OR_RETURN(result->initial_model, engine::FitModel(workspace.experiment, base));
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation best, search.Run(base, initial_effects));
  if (before) {
    engine::Explanation known;
    known.initial_effects = initial_effects;
    known.fit.model = *before;
    TOUCHSTONE_ASSIGN_OR_RETURN(known, search.Continue(std::move(known)));
    if (known.fit.log_evidence > best.fit.log_evidence + kSelectionRules.as_good) best = std::move(known);
  }
  result->formula = -1;
  FormulaTerm* first = nullptr;
  for (int terms = 0; terms < kSelectionRules.max_formula_terms; ++terms) {
    TOUCHSTONE_ASSIGN_OR_RETURN(WithTerm with, TryTerms(workspace, search, best, first, best.fit));
    if (!with.found && terms == 0) {
      TOUCHSTONE_ASSIGN_OR_RETURN(with, TryTermsInPlaceOfEffects(workspace, best, result));
    }
    if (!with.found) break;
    // From scratch, with the formula's term as one effect among the others.
    const auto effect = MakeTermEffect(NameOfRest(with.term.covariate), with.term);
    if (!effect.ok()) return effect.status();
    engine::Parameterization start = base;
    start.Add(*effect, false);
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Explanation again, search.Run(start, initial_effects));
    // It may have led the search to effects that do without it.
    const bool better = again.fit.log_evidence > with.explanation.fit.log_evidence - kSelectionRules.as_good;
    best = std::move(better ? again : with.explanation);
    result->formula = FindFormula(best.fit, initial_effects, NameOfRest(with.term.covariate));
    result->term = with.term;
    first = result->formula < 0 ? nullptr : &result->term;
  }
  result->fit = best.fit;
  result->without_formula = best.fit;
  if (result->formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        result->without_formula,
        engine::FitModel(workspace.experiment, best.fit.model.Without(result->formula)));
  }
  return CompeteWithCurves(workspace, result);
}

}  // namespace

void NoteRival(const std::string& effect, const engine::NamelessRival& rival, SelectionResult* result) {
  const auto [noted, is_new] = result->nameless_rivals.try_emplace(effect, rival);
  if (!is_new && rival.ahead_nats > noted->second.ahead_nats) noted->second = rival;
}

absl::Status FindCompetingEffects(SelectionResult* result) {
  const engine::Explanation whole{result->fit, result->initial_effects};
  TOUCHSTONE_ASSIGN_OR_RETURN(result->steps, engine::FindCompetitors(*result->search, whole, result->formula,
                                                                     result->nameless_rivals));
  return absl::OkStatus();
}

std::vector<double> ResidualsWithoutSurface(const Workspace& workspace, const engine::Fit& fit) {
  const Eigen::VectorXd left =
      fit.columns.values.col(0) -
      workspace.likelihood->FieldMean(engine::Likelihood::Pick(fit.columns, {0}), fit.hypothesis);
  return workspace.contrasts->PerFinger(left, workspace.searched->time_s.size());
}

double SurfaceErrorNats(const Workspace& workspace, const engine::Fit& fit) {
  std::vector<int> members(fit.model.size() + 1);
  for (int i = 0; i <= fit.model.size(); ++i) members[i] = i;
  const std::vector<Eigen::MatrixXd> grams = {workspace.likelihood->Gram(fit.columns, 0)};
  const double none =
      engine::ComputeLaplaceEvidence(*workspace.likelihood, grams, members, fit.model.parameters(), fit.point)
          .log_evidence;
  const double excess = fit.log_evidence - none;  // log of (none + some) / none
  return excess > 30 ? excess : std::log(std::max(std::expm1(excess), 1e-12));
}

namespace {

// The noise of what the fit leaves, on all touches.
absl::StatusOr<touches::NoiseFindings> NoiseOf(const Workspace& workspace, const engine::Fit& fit) {
  const touches::Observations& o = *workspace.observations;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.predictor->Run(fit.model.base(), true, false));
  const std::vector<double> residuals =
      workspace.thinned ? touches::Residuals(o, details) : ResidualsWithoutSurface(workspace, fit);
  const double surface_dof =
      workspace.thinned ? 0 : workspace.likelihood->hypotheses()[fit.hypothesis].effective_dof;
  touches::DeclaredNoise declared = DeclaredNoiseOf(*workspace.input.model);
  // Tails may stand for the outliers that were left out.
  if (o.unused.count(touches::kOutlierReason) > 0) declared.degrees_of_freedom.reset();
  return touches::FindNoise(touches::MakeNoiseSample(o, residuals, details), fit.model.size() + surface_dof,
                            declared);
}

}  // namespace

absl::StatusOr<SelectionResult> SelectExplanation(Workspace* workspace) {
  SelectionResult result;
  std::vector<double> weights;
  // The share that is done stays where the caller has put it.
  const auto progress = [workspace](const std::string& what) {
    if (workspace->context.progress) workspace->context.progress(what, 0);
  };
  engine::TriedPValues tried;
  std::optional<GroupDifference> group;
  std::optional<engine::Parameterization> before;
  LeaveOutWild(workspace);
  for (int pass = 0; pass < kSelectionRules.passes; ++pass) {
    TOUCHSTONE_RETURN_IF_ERROR(PrepareSearch(workspace, weights));
    result = SelectionResult();
    result.search = std::make_unique<engine::StepwiseSearch>(
        workspace->experiment, MakeCandidates(workspace->input, *workspace->searched), engine::SearchRules(),
        progress);
    engine::GivenAndEffects columns;
    // Of the touches that are assessed: outliers that left are no hypothesis, what a part of the session has is one.
    if (!group) {
      TOUCHSTONE_ASSIGN_OR_RETURN(columns, engine::ColumnsOfEffects(*result.search, *workspace->input.model));
      TOUCHSTONE_ASSIGN_OR_RETURN(tried, TryOnTouches(*workspace, columns));
    }
    TOUCHSTONE_RETURN_IF_ERROR(FindCauses(*workspace, before, &result));
    if (pass == 0) {
      TOUCHSTONE_ASSIGN_OR_RETURN(group, FindGroupDifference(*workspace, columns, result));
      if (group) {
        LeaveOutRows(*group, workspace->observations.get());
        continue;
      }
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(result.noise, NoiseOf(*workspace, result.fit));
    if (pass + 1 == kSelectionRules.passes) break;
    const std::vector<int>& outliers = pass == 0 ? result.noise.farthest_outliers : result.noise.outliers;
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool revised, ReviseTouches(result, outliers, workspace, &weights));
    if (!revised) break;
    before = result.without_formula.model;
  }
  result.tried = std::move(tried);
  result.group = std::move(group);
  if (result.memory) result.noise.sigma_s = result.memory->white_s;
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool unseen, DropUnseen(*workspace, &result));
  if (unseen) {
    TOUCHSTONE_RETURN_IF_ERROR(FitCurveAnew(*workspace, &result));
  }
  TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(&result));
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool dropped, DropImprobable(*workspace, &result));
  if (dropped) {
    TOUCHSTONE_RETURN_IF_ERROR(FitCurveAnew(*workspace, &result));
    TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(&result));
  }
  if (result.formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const touches::Prediction details,
        workspace->searched_predictor->Run(result.without_formula.model.base(), true, true));
    result.terms = ScoreTerms(workspace->experiment, *workspace->rows, result.without_formula, details);
  }
  const engine::SurfaceErrorHypothesis& hypothesis =
      workspace->likelihood->hypotheses()[result.fit.hypothesis];
  result.surface_error = {SurfaceErrorNats(*workspace, result.fit),
                          hypothesis.amplitude_over_sigma * result.fit.sigma, hypothesis.length_m,
                          hypothesis.effective_dof};
  return result;
}

}  // namespace touchstone::diagnosis::selection
