#include "server/diagnosis/selection/curves/suggested_rest.h"

#include <utility>

#include "server/base/status.h"
#include "server/diagnosis/selection/curve_competition.h"
#include "server/diagnosis/selection/curves/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// Whether what explains the rest in the fit is a curve and no formula.
bool HasCurveAsEffect(const SelectionResult& result) {
  return result.formula >= 0 && result.fit.model.base().effects[result.formula].effect->lookup != nullptr;
}

}  // namespace

absl::Status FitCurveAnew(const Workspace& workspace, SelectionResult* result) {
  if (!result->curve) return absl::OkStatus();
  if (HasCurveAsEffect(*result)) {
    result->fit = result->without_formula;
    result->formula = -1;
    result->term = FormulaTerm();
  }
  result->curve.reset();
  return CompeteWithCurves(workspace, result);
}

const FormulaTerm* NearestTerm(const std::vector<FormulaTerm>& terms, const NamelessCurve& curve) {
  const FormulaTerm* nearest = nullptr;
  for (const FormulaTerm& term : terms)
    if (term.covariate == curve.covariate && (nearest == nullptr || term.gain_nats > nearest->gain_nats))
      nearest = &term;
  if (nearest == nullptr || !(curve.gain_nats > 0) ||
      nearest->gain_nats < kCurveRules.near_share * curve.gain_nats)
    return nullptr;
  return nearest;
}

absl::StatusOr<bool> UseNearestFormula(const Workspace& workspace, SelectionResult* result) {
  if (!result->curve || !HasCurveAsEffect(*result)) return false;
  const engine::Fit& without = result->without_formula;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.searched_predictor->Run(without.model.base(), true, true));
  const std::vector<FormulaTerm> terms = ScoreTerms(workspace.experiment, *workspace.rows, without, details);
  const FormulaTerm* nearest = NearestTerm(terms, *result->curve);
  if (nearest == nullptr) return false;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto effect, MakeTermEffect(NameOfRest(nearest->covariate), *nearest));
  engine::Parameterization start = without.model;
  start.Add(effect, false);
  TOUCHSTONE_ASSIGN_OR_RETURN(result->fit, engine::FitModel(workspace.experiment, std::move(start)));
  result->formula = static_cast<int>(result->fit.model.base().effects.size()) - 1;
  result->term = *nearest;
  return true;
}

}  // namespace touchstone::diagnosis::selection
