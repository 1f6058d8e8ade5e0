#include "server/diagnosis/selection/selection.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/decompositions.h"
#include "server/base/status.h"
#include "server/diagnosis/inference/held_out.h"
#include "server/diagnosis/selection/curve_competition.h"
#include "server/diagnosis/selection/declared_noise.h"
#include "server/diagnosis/selection/result.h"
#include "server/diagnosis/selection/unsupported_steps.h"
#include "server/diagnosis/touches/noise_sample.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kTermsFitted = 3;
constexpr int kMaxFormulaTerms = 2;
constexpr int kPasses = 3;
constexpr double kSameLikelihoodNats = 1;  // less is no difference
constexpr double kAlike = 0.03;            // share of a response that another effect may leave out
constexpr double kBoundTolerance = 1e-6;   // of the typical size
constexpr double kWorthSayingNats = 5;     // a curve that is not farther behind is named beside the effect

std::string FormulaName(const FormulaTerm& term) {
  std::string name = "rest_" + term.covariate;
  return name.substr(0, 60);
}

// The best fit with one more term of the dictionary, if it is worth its complexity.
struct WithTerm {
  bool found = false;
  FormulaTerm term;
  Explanation explanation;
};

// The index of the formula of this name among the effects that were added; -1: there is none.
int FindFormula(const inference::Fit& fit, int initial_effects, const std::string& name) {
  for (int index = initial_effects; index < static_cast<int>(fit.model.base().effects.size()); ++index) {
    const model::Effect& effect = *fit.model.base().effects[index].effect;
    if (effect.formula != nullptr && effect.formula->name == name) return index;
  }
  return -1;
}

absl::StatusOr<WithTerm> TryTerms(const Workspace& workspace, const StepwiseSearch& search,
                                  const Explanation& without, const FormulaTerm* first) {
  const inference::Experiment& experiment = workspace.experiment;
  WithTerm best;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.searched_predictor->Run(without.fit.model.base(), true, true));
  const std::vector<FormulaTerm> terms = ScoreTerms(experiment, *workspace.rows, without.fit, details);
  const double penalty_nats = search.rules().complexity_penalty_nats;
  double best_evidence = without.fit.log_evidence + search.rules().enter_nats + penalty_nats;
  int fitted = 0;
  for (const FormulaTerm& candidate : terms) {
    if (fitted++ == kTermsFitted || candidate.gain_nats < 0.5 * penalty_nats) break;
    FormulaTerm term = candidate;
    inference::Parameterization base = without.fit.model;
    if (first != nullptr) {
      // The second term joins the first in one expression.
      term = Sum(*first, candidate);
      const int at = FindFormula(without.fit, without.initial_effects, FormulaName(*first));
      if (at >= 0) base = base.Without(at);
      term.covariate = first->covariate;
    }
    const auto effect = MakeTermEffect(FormulaName(term), term);
    if (!effect.ok()) return effect.status();
    inference::Parameterization start = base;
    start.Add(*effect, false);
    absl::StatusOr<inference::Fit> fit = inference::FitModel(experiment, std::move(start));
    if (!fit.ok() && fit.status().code() == absl::StatusCode::kCancelled) return fit.status();
    if (!fit.ok() || fit->log_evidence <= best_evidence) continue;
    const double gain =
        1 - inference::HeldOutRmse(experiment, *fit) / inference::HeldOutRmse(experiment, without.fit);
    if (gain < search.rules().min_relative_cv_gain) continue;
    best_evidence = fit->log_evidence;
    best.found = true;
    best.term = term;
    best.explanation.fit = *std::move(fit);
    best.explanation.initial_effects = without.initial_effects;
  }
  return best;
}

// Effects of the catalogue first; what they leave may follow a formula; with the formula in place some of the
// effects may turn out to have stood in for it.
absl::Status FindCauses(const Workspace& workspace, SelectionResult* result) {
  const StepwiseSearch& search = *result->search;
  const int initial_effects = static_cast<int>(workspace.input.model->effects.size());
  result->initial_effects = initial_effects;
  inference::Parameterization base(*workspace.input.model, workspace.searched->objects);
  TOUCHSTONE_ASSIGN_OR_RETURN(result->initial_model, inference::FitModel(workspace.experiment, base));
  TOUCHSTONE_ASSIGN_OR_RETURN(Explanation best, search.Run(base, initial_effects));
  result->formula = -1;
  FormulaTerm* first = nullptr;
  for (int terms = 0; terms < kMaxFormulaTerms; ++terms) {
    TOUCHSTONE_ASSIGN_OR_RETURN(WithTerm with, TryTerms(workspace, search, best, first));
    if (!with.found) break;
    // From scratch, with the formula's term as one effect among the others.
    const auto effect = MakeTermEffect(FormulaName(with.term), with.term);
    if (!effect.ok()) return effect.status();
    inference::Parameterization start = base;
    start.Add(*effect, false);
    TOUCHSTONE_ASSIGN_OR_RETURN(Explanation again, search.Run(start, initial_effects));
    const int at = FindFormula(again.fit, initial_effects, FormulaName(with.term));
    if (at >= 0 && again.fit.log_evidence > with.explanation.fit.log_evidence - 0.5) {
      best = std::move(again);
    } else {
      best = std::move(with.explanation);
    }
    result->term = with.term;
    result->formula = FindFormula(best.fit, initial_effects, FormulaName(with.term));
    first = &result->term;
  }
  result->fit = best.fit;
  result->without_formula = best.fit;
  if (result->formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        result->without_formula,
        inference::FitModel(workspace.experiment, best.fit.model.Without(result->formula)));
  }
  return CompeteWithCurves(workspace, result);
}

Eigen::MatrixXd ColumnsOf(const inference::Fit& fit, int effect) {
  Eigen::MatrixXd columns(fit.columns.values.rows(), 0);
  for (int i = 0; i < fit.model.size(); ++i) {
    if (fit.model.parameters()[i].effect != effect) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = fit.columns.values.col(1 + i);
  }
  return columns;
}

// Whether the other effect moves the rows as this one does, however far.
bool ActsAlike(const inference::Fit& fit, int effect, const inference::Fit& other_fit, int other) {
  const Eigen::MatrixXd own = ColumnsOf(fit, effect), span = ColumnsOf(other_fit, other);
  if (own.cols() == 0 || span.cols() == 0 || own.rows() != span.rows()) return false;
  const Eigen::MatrixXd outside = own - span * SolveLeastSquaresColumns(span, own);
  return outside.norm() < kAlike * own.norm();
}

absl::Status FindCompetingEffects(SelectionResult* result) {
  Explanation whole{result->fit, result->initial_effects};
  const StepwiseSearch& search = *result->search;
  for (int index = result->initial_effects; index < static_cast<int>(result->fit.model.base().effects.size());
       ++index) {
    if (index == result->formula) continue;
    SelectedStep step;
    step.effect = index;
    TOUCHSTONE_ASSIGN_OR_RETURN(const inference::Fit without, search.WithoutEffect(whole, index));
    step.gain_nats = result->fit.log_evidence - without.log_evidence;
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<CompetingFit> competing,
                                search.CompetingFits(whole, index));
    const std::string own = inference::NameOf(*result->fit.model.base().effects[index].effect);
    const std::string own_object = result->fit.model.OnlyObject(index);
    // Log evidence over the step's own: that nothing takes its place, what else could, what is equivalent.
    std::vector<double> all = {-step.gain_nats}, same_or_equivalent;
    for (const CompetingFit& competitor : competing) {
      const double evidence = competitor.fit.log_evidence - result->fit.log_evidence;
      const bool same = competitor.name == own && competitor.object == own_object;
      const bool declared =
          IsDeclaredConfounded(*result->fit.model.base().effects[index].effect, competitor.name);
      // Equivalent: as probable, or as likely with no more parameters, whatever rigs usually show; with more of them
      // if it is known to hold this effect as a part; or stopped by its bound and nothing else.
      const bool as_likely = competitor.fit.log_likelihood > result->fit.log_likelihood - kSameLikelihoodNats;
      const int added = static_cast<int>(competitor.fit.model.base().effects.size()) - 1;
      const bool stopped = declared && added >= result->initial_effects && IsAtBound(competitor.fit, added) &&
                           !IsAtBound(result->fit, index) &&
                           ActsAlike(result->fit, index, competitor.fit, added);
      const bool equivalent =
          evidence > -search.rules().equivalent_nats ||
          (as_likely && (declared || competitor.fit.model.size() <= result->fit.model.size())) || stopped;
      all.push_back(evidence);
      if (same || equivalent) same_or_equivalent.push_back(evidence);
      if (same) continue;
      step.competing.push_back({competitor.name, competitor.per_object, competitor.object, evidence,
                                equivalent, stopped, competitor.fit.model.base()});
    }
    // A curve without a name may say the same as an effect of time.
    if (const auto rival = result->curve_rivals.find(own); rival != result->curve_rivals.end()) {
      all.push_back(rival->second.ahead_nats);
      if (rival->second.ahead_nats > -kWorthSayingNats) step.words = rival->second.words;
    }
    step.probability = ProbabilityOfShare(inference::LogSum(same_or_equivalent) - inference::LogSum(all));
    result->steps.push_back(std::move(step));
  }
  return absl::OkStatus();
}

}  // namespace

bool IsAtBound(const inference::Fit& fit, int index) {
  for (int i = 0; i < fit.model.size(); ++i) {
    const inference::FreeParameter& p = fit.model.parameters()[i];
    const double near = kBoundTolerance * p.scale;
    if (p.effect != index || std::abs(fit.point[i] - p.neutral) <= near) continue;
    if (fit.point[i] <= p.lower + near || fit.point[i] >= p.upper - near) return true;
  }
  return false;
}

std::vector<double> ResidualsWithoutSurface(const Workspace& workspace, const inference::Fit& fit) {
  const touches::Contrasts& contrasts = *workspace.contrasts;
  const touches::Observations& o = *workspace.searched;
  const Eigen::VectorXd left =
      fit.columns.values.col(0) -
      workspace.likelihood->FieldMean(inference::Likelihood::Pick(fit.columns, {0}), fit.hypothesis);
  std::vector<double> residuals(o.time_s.size(), NAN);
  for (size_t t = 0; t < contrasts.touches().size(); ++t) {
    const Eigen::MatrixXd& h = contrasts.MatrixOf(static_cast<int>(t));
    const int first = contrasts.FirstRow(static_cast<int>(t));
    for (int i = 0; i < o.fingers; ++i) {
      if (!contrasts.TakesPart(static_cast<int>(t), i)) continue;
      double sum = 0;
      for (int row = 0; row < h.rows(); ++row) sum += h(row, i) * left[first + row];
      residuals[static_cast<size_t>(contrasts.touches()[t]) * o.fingers + i] =
          sum / contrasts.root_weights()[t];
    }
  }
  return residuals;
}

double ProbabilityOfShare(double log_share) {
  return std::min(kMaxProbability, std::exp(log_share));
}

double ProbabilityOf(double log_odds) {
  return ProbabilityOfShare(-std::log1p(std::exp(-log_odds)));
}

double SurfaceErrorNats(const Workspace& workspace, const inference::Fit& fit) {
  std::vector<int> members(fit.model.size() + 1);
  for (int i = 0; i <= fit.model.size(); ++i) members[i] = i;
  const std::vector<Eigen::MatrixXd> grams = {workspace.likelihood->Gram(fit.columns, 0)};
  const double none = inference::ComputeLaplaceEvidence(*workspace.likelihood, grams, members,
                                                        fit.model.parameters(), fit.point)
                          .log_evidence;
  const double excess = fit.log_evidence - none;  // log of (none + some) / none
  return excess > 30 ? excess : std::log(std::max(std::expm1(excess), 1e-12));
}

namespace {

// The noise of what the fit leaves, on all touches.
absl::StatusOr<inference::NoiseFindings> NoiseOf(const Workspace& workspace, const inference::Fit& fit) {
  const touches::Observations& o = *workspace.observations;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.predictor->Run(fit.model.base(), true, false));
  const std::vector<double> residuals =
      workspace.thinned ? touches::Residuals(o, details) : ResidualsWithoutSurface(workspace, fit);
  const double surface_dof =
      workspace.thinned ? 0 : workspace.likelihood->hypotheses()[fit.hypothesis].effective_dof;
  inference::DeclaredNoise declared = DeclaredNoiseOf(*workspace.input.model);
  // Tails may stand for the outliers that were left out.
  if (o.unused.count(touches::kOutlierReason) > 0) declared.degrees_of_freedom.reset();
  return inference::FindNoise(touches::MakeNoiseSample(o, residuals, touches::TangentsOfIncidence(details),
                                                       touches::ExpectedReadings(o, details)),
                              fit.model.size() + surface_dof, declared);
}

// Where the better model says that a finger all but misses an edge, outliers, touches of little worth: they leave or
// count less. Returns whether anything changed; `weights`: by row of the set.
absl::StatusOr<bool> ReviseTouches(const inference::Fit& fit, const inference::NoiseFindings& noise,
                                   Workspace* workspace, std::vector<double>* weights) {
  touches::Observations& o = *workspace->observations;
  TOUCHSTONE_ASSIGN_OR_RETURN(const int edges, LeaveOutEdges(*workspace->predictor, fit.model.base(), &o));
  const bool reweigh = weights->empty() && !noise.weights.empty();
  if (edges == 0 && noise.outliers.empty() && !reweigh) return false;
  for (const int k : noise.outliers) touches::LeaveOut(&o, k, touches::kOutlierReason);
  weights->clear();
  if (noise.weights.empty()) return true;
  weights->assign(o.set->size(), 1.0);
  for (int k = 0; k < o.size(); ++k) (*weights)[o.row[k]] = noise.weights[k];
  return true;
}

}  // namespace

absl::StatusOr<SelectionResult> SelectExplanation(Workspace* workspace) {
  SelectionResult result;
  std::vector<double> weights;
  // The share that is done stays where the caller has put it.
  const auto progress = [workspace](const std::string& what) {
    if (workspace->context.progress) workspace->context.progress(what, 0);
  };
  for (int pass = 0; pass < kPasses; ++pass) {
    TOUCHSTONE_RETURN_IF_ERROR(PrepareSearch(workspace, weights));
    result = SelectionResult();
    result.search = std::make_unique<StepwiseSearch>(workspace->experiment,
                                                     MakeCandidates(workspace->input, *workspace->searched),
                                                     SearchRules(), progress);
    TOUCHSTONE_RETURN_IF_ERROR(FindCauses(*workspace, &result));
    TOUCHSTONE_ASSIGN_OR_RETURN(result.noise, NoiseOf(*workspace, result.fit));
    if (pass + 1 == kPasses) break;
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool revised,
                                ReviseTouches(result.fit, result.noise, workspace, &weights));
    if (!revised) break;
  }
  if (result.memory) result.noise.sigma_s = result.memory->white_s;
  TOUCHSTONE_RETURN_IF_ERROR(DropUnseen(*workspace, &result));
  TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(&result));
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool dropped, DropImprobable(*workspace, &result));
  if (dropped) {
    result.steps.clear();
    TOUCHSTONE_RETURN_IF_ERROR(FindCompetingEffects(&result));
  }
  if (result.formula >= 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const touches::Prediction details,
        workspace->searched_predictor->Run(result.without_formula.model.base(), true, true));
    result.terms = ScoreTerms(workspace->experiment, *workspace->rows, result.without_formula, details);
  }
  const inference::SurfaceErrorHypothesis& hypothesis =
      workspace->likelihood->hypotheses()[result.fit.hypothesis];
  result.surface_error = {SurfaceErrorNats(*workspace, result.fit),
                          hypothesis.amplitude_over_sigma * result.fit.sigma, hypothesis.length_m,
                          hypothesis.effective_dof};
  return result;
}

}  // namespace touchstone::diagnosis::selection
