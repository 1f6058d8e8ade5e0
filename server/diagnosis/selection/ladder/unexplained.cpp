// What is left when no cause of the catalogue explains it.

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/curves/curve_effect.h"
#include "server/diagnosis/selection/curves/suggested_rest.h"
#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/ladder/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// Cosine between a column and the nearest point of the span of others, all without `own`.
double Cosine(const Eigen::MatrixXd& own, const Eigen::VectorXd& column, const Eigen::MatrixXd& span) {
  const auto without = [&](const Eigen::MatrixXd& values) -> Eigen::MatrixXd {
    if (own.cols() == 0) return values;
    return values - own * SolveLeastSquaresColumns(own, values);
  };
  const Eigen::VectorXd c = without(column);
  const Eigen::MatrixXd s = without(span);
  if (!(c.norm() > 0) || !(s.norm() > 0)) return 0;
  return (s * SolveLeastSquares(s, c)).norm() / c.norm();
}

// The formula as it stands in a model file.
std::string FormulaYaml(const engine::Fit& fit, int index) {
  model::Model only = fit.model.base();
  only.effects = {only.effects[index]};
  model::EffectInstance& instance = only.effects[0];
  size_t at_value = 0;  // a formula's parameters are numbers
  for (const engine::ParameterEstimate& estimate : fit.model.Describe(index, fit.point, fit.covariance)) {
    const model::ParameterInfo& parameter = instance.effect->parameters[at_value];
    instance.values[at_value++] = ToSi(parameter.unit, engine::RoundedTo(estimate.value, estimate.std_error));
  }
  return engine::EffectYaml(only, std::move(only.effects[0]));
}

// Each covariate by its best term, the number of terms paid for; those that chance hardly brings about, largest
// gain first. `first`: a covariate that stands before all others; empty: none.
std::vector<engine::CovariateTest> TestCovariates(const std::vector<FormulaTerm>& terms,
                                                  const std::string& first) {
  std::map<std::string, engine::CovariateTest> tests;
  for (const FormulaTerm& term : terms) {
    const double tail = ChiSquaredTail(2 * term.log_ratio, term.degrees_of_freedom);
    const double p = std::min(1.0, tail * static_cast<double>(terms.size()));
    engine::CovariateTest& test = tests[term.covariate];
    if (!test.name.empty() && test.gain_nats >= term.gain_nats) continue;
    test = {term.covariate, p, term.gain_nats};
  }
  std::vector<engine::CovariateTest> sorted;
  for (auto& [name, test] : tests) sorted.push_back(std::move(test));
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const engine::CovariateTest& a, const engine::CovariateTest& b) {
                     return a.gain_nats > b.gain_nats;
                   });
  std::stable_partition(sorted.begin(), sorted.end(),
                        [&](const engine::CovariateTest& test) { return test.name == first; });
  std::vector<engine::CovariateTest> kept;
  for (const engine::CovariateTest& test : sorted)
    if (kept.size() < kLadderRules.max_covariates && test.p < kLadderRules.covariate_p) kept.push_back(test);
  return kept;
}

// The formula, its values, and what it would do.
absl::Status DescribeFormula(const Workspace& workspace, const SelectionResult& selection,
                             const engine::Quality& final, double floor_s, engine::UnexplainedRest* rest) {
  const engine::Fit& fit = selection.fit;
  const model::EffectInstance& instance = fit.model.base().effects[selection.formula];
  rest->formula = instance.effect->formula->expression;
  rest->formula_yaml = FormulaYaml(fit, selection.formula);
  rest->parameters = fit.model.Describe(selection.formula, fit.point, fit.covariance);
  TOUCHSTONE_ASSIGN_OR_RETURN(const engine::Quality quality,
                              QualityOfModel(workspace, fit, *rest->model_with));
  rest->rmse = quality.rmse;
  rest->heldout_rmse = quality.heldout_rmse;
  rest->heldout_gain = engine::ExplainedShare(final.heldout_rmse, quality.heldout_rmse, floor_s);
  return absl::OkStatus();
}

// What the curve in the model does; errors on unseen touches are refitted without parts of them.
absl::Status DescribeCurve(const Workspace& workspace, const SelectionResult& selection,
                           const engine::Quality& final, double floor_s, engine::UnexplainedRest* rest) {
  const NamelessCurve& curve = *selection.curve;
  TOUCHSTONE_ASSIGN_OR_RETURN(rest->rmse, ErrorAsCompared(workspace, *rest->model_with));
  const double in_sample = std::sqrt(selection.fit.columns.values.col(0).squaredNorm() /
                                     std::max<double>(1, selection.fit.columns.values.rows()));
  const double ratio = in_sample > 0 ? std::max(1.0, curve.heldout_with_s / in_sample) : 1;
  rest->heldout_rmse = rest->rmse * ratio;
  rest->heldout_gain = engine::ExplainedShare(final.rmse, rest->heldout_rmse, floor_s);
  return absl::OkStatus();
}

// Curves among the covariates: the one that explains the rest first, then those that gain most.
void AddCurves(const SelectionResult& selection, std::vector<engine::CovariateTest>* tests) {
  for (const NamelessCurve& curve : selection.curves) {
    if (!IsSignificant(curve)) continue;
    const engine::CovariateTest found = {curve.covariate, curve.p, curve.gain_nats};
    const auto same = std::find_if(tests->begin(), tests->end(), [&](const engine::CovariateTest& test) {
      return test.name == found.name;
    });
    if (same == tests->end())
      tests->push_back(found);
    else if (same->gain_nats < found.gain_nats)
      *same = found;
  }
  std::stable_sort(tests->begin(), tests->end(),
                   [](const engine::CovariateTest& a, const engine::CovariateTest& b) {
                     return a.gain_nats > b.gain_nats;
                   });
  if (selection.curve) {
    const std::string& first = selection.curve->covariate;
    std::stable_partition(tests->begin(), tests->end(),
                          [&](const engine::CovariateTest& test) { return test.name == first; });
  }
  if (tests->size() > kLadderRules.max_covariates) tests->resize(kLadderRules.max_covariates);
}

// The term of the curve's covariate that gains most, if it is worth a look, and how much of the curve's gain that is.
void AddNearestFormula(const std::vector<FormulaTerm>& terms, const NamelessCurve& curve,
                       engine::UnexplainedRest* rest) {
  const FormulaTerm* nearest = NearestTerm(terms, curve);
  if (nearest == nullptr) return;
  rest->nearest_formula = nearest->expression;
  rest->nearest_formula_share = std::min(1.0, nearest->gain_nats / curve.gain_nats);
}

// Whether the improved model compares better with the effect.
absl::StatusOr<bool> LowersError(const Workspace& workspace, const Ladder& ladder,
                                 const std::shared_ptr<const model::Effect>& effect) {
  model::Model with = ladder.improved;
  with.effects.push_back({effect, false, {}, {}});
  TOUCHSTONE_ASSIGN_OR_RETURN(const double error_s, ErrorAsCompared(workspace, with));
  return error_s < ladder.final.rmse;
}

// What of the catalogue looks most like the formula.
absl::Status FindNearestEffect(const Workspace& workspace, const SelectionResult& selection,
                               engine::UnexplainedRest* rest) {
  const engine::Fit& fit = selection.fit;
  const engine::Fit& without = selection.without_formula;
  const int own = without.model.size();
  const Eigen::MatrixXd others = without.columns.values.rightCols(own);
  Eigen::VectorXd column;
  for (int i = 0; i < fit.model.size(); ++i)
    if (fit.model.parameters()[i].effect == selection.formula && column.size() == 0)
      column = fit.columns.values.col(1 + i);
  // A curve has no parameter: what it takes off the residuals stands for it.
  if (fit.model.base().effects[selection.formula].effect->lookup != nullptr)
    column = without.columns.values.col(0) - fit.columns.values.col(0);
  if (column.size() == 0) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<engine::Extension> extensions,
                              selection.search->Score(without, selection.initial_effects));
  for (const engine::Extension& extension : extensions) {
    if (extension.candidate < 0 || !extension.Acts() || !extension.object.empty()) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd span,
                                engine::ResponseColumns(workspace.experiment, extension, without));
    if (span.cols() > kLadderRules.max_span) continue;
    const double cosine = Cosine(others, column, span);
    if (cosine <= rest->nearest_cosine) continue;
    rest->nearest_cosine = cosine;
    rest->nearest_effect = extension.name;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<engine::UnexplainedRest> DescribeUnexplained(const Workspace& workspace,
                                                            const SelectionResult& selection,
                                                            const Ladder& ladder,
                                                            std::optional<model::Model> with) {
  std::vector<FormulaTerm> terms = selection.terms;
  if (terms.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                                workspace.searched_predictor->Run(selection.fit.model.base(), true, true));
    terms = ScoreTerms(workspace.experiment, *workspace.rows, selection.fit, details);
  }
  engine::UnexplainedRest rest;
  rest.model_with = std::move(with);
  rest.covariates = TestCovariates(terms, selection.formula >= 0 ? selection.term.covariate : "");
  AddCurves(selection, &rest.covariates);
  const bool is_curve = selection.formula >= 0 &&
                        selection.fit.model.base().effects[selection.formula].effect->lookup != nullptr;
  if (selection.curve) {
    const auto effect = MakeCurveEffect(*selection.curve);
    bool helps = effect.ok();
    if (helps && is_curve) helps = rest.model_with.has_value();
    if (helps && !is_curve) {
      TOUCHSTONE_ASSIGN_OR_RETURN(helps, LowersError(workspace, ladder, *effect));
    }
    if (helps) {
      rest.lookup_yaml = engine::EffectYaml(selection.fit.model.base(), {*effect, false, {}, {}});
      rest.lookup = *effect;
      AddNearestFormula(terms, *selection.curve, &rest);
    }
  }
  if (!rest.model_with) return rest;
  const auto describe = is_curve ? DescribeCurve : DescribeFormula;
  TOUCHSTONE_RETURN_IF_ERROR(describe(workspace, selection, ladder.final, ladder.noise_floor.sigma, &rest));
  TOUCHSTONE_RETURN_IF_ERROR(FindNearestEffect(workspace, selection, &rest));
  return rest;
}

}  // namespace touchstone::diagnosis::selection
