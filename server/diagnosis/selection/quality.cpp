#include "server/diagnosis/selection/quality.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/fit/held_out.h"
#include "server/diagnosis/selection/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// Without repeats: how much better a smooth remainder explains the residuals than none.
double SmoothRemainderP(const Workspace& workspace, const engine::Fit& fit) {
  const double gain = std::max(SurfaceErrorNats(workspace, fit), 0.0);
  return 0.5 * ChiSquaredTail(2 * gain, 1) + (gain > 0 ? 0 : 0.5);
}

}  // namespace

double HeldOutRatio(const engine::Fit& fit, double heldout_rmse_s) {
  const double rmse_s = std::sqrt(fit.columns.values.col(0).squaredNorm() /
                                  std::max<double>(1, static_cast<double>(fit.columns.values.rows())));
  return rmse_s > 0 ? std::max(heldout_rmse_s / rmse_s, 1.0) : 1;
}

double RoundingS(const touches::Observations& o) {
  double squares = 0, count = 0;
  for (int k = 0; k < o.size(); ++k)
    if (const double speed_m_s = o.set->speed_m_s[o.row[k]]; o.used[k] && speed_m_s > 0)
      squares += 1 / (speed_m_s * speed_m_s), count += 1;
  return count > 0 ? kSelectionRules.rounding.value() * std::sqrt(squares / count) : 0;
}

bool HasRepeats(const touches::SumOfSquares& error) {
  return error.degrees_of_freedom >= kSelectionRules.min_repeat_dof;
}

double LackOfFitP(const touches::Observations& o, const std::vector<double>& residuals, double parameters) {
  const touches::SumOfSquares pure = PureErrorOf(o, residuals), total = touches::TotalSquares(o, residuals);
  const double dof = total.degrees_of_freedom - pure.degrees_of_freedom - parameters;
  const double noise =
      std::max(std::sqrt(pure.sum_of_squares / std::max(pure.degrees_of_freedom, 1.0)), RoundingS(o));
  if (!HasRepeats(pure) || dof < 1 || !(noise > 0)) return 1;
  const double f = std::max(total.sum_of_squares - pure.sum_of_squares, 0.0) / dof / (noise * noise);
  return FisherTail(f, dof, pure.degrees_of_freedom);
}

absl::StatusOr<engine::Quality> QualityOf(const Workspace& workspace, const engine::Fit& fit,
                                          const std::vector<double>& residuals) {
  engine::Quality quality;
  const touches::Observations& o = *workspace.observations;
  quality.rmse = touches::Rmse(o, residuals);
  TOUCHSTONE_ASSIGN_OR_RETURN(const double heldout_rmse_s,
                              engine::HeldOutRmseRefitted(workspace.experiment, fit));
  quality.heldout_rmse = quality.rmse * HeldOutRatio(fit, heldout_rmse_s);
  quality.lack_of_fit_p = HasRepeats(PureErrorOf(o, residuals)) ? LackOfFitP(o, residuals, fit.model.size())
                                                                : SmoothRemainderP(workspace, fit);
  return quality;
}

absl::StatusOr<touches::Observations> UsableUnder(const Workspace& workspace, const model::Model& model,
                                                  const touches::Prediction& prediction,
                                                  const std::vector<char>& used) {
  touches::Observations o = *workspace.observations;
  o.used = used;
  LeaveOutMissed(prediction, &o);
  TOUCHSTONE_RETURN_IF_ERROR(LeaveOutEdges(*workspace.predictor, model, &o).status());
  return o;
}

absl::StatusOr<double> ErrorAsCompared(const Workspace& workspace, const model::Model& model) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              workspace.predictor->Run(model, false, false));
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations o,
                              UsableUnder(workspace, model, prediction, workspace.comparable));
  return touches::Rmse(o, touches::Residuals(o, prediction));
}

engine::Quality QualityAsCompared(const touches::Observations& o, const std::vector<double>& residuals) {
  const double rmse_s = touches::Rmse(o, residuals);
  return {rmse_s, rmse_s, LackOfFitP(o, residuals, 0)};
}

void SetError(double rmse_s, engine::Quality* quality) {
  if (quality->rmse > 0) quality->heldout_rmse *= rmse_s / quality->rmse;
  quality->rmse = rmse_s;
}

absl::StatusOr<engine::Quality> QualityOfModel(const Workspace& workspace, const engine::Fit& fit,
                                               const model::Model& model) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              workspace.predictor->Run(model, false, false));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      engine::Quality quality,
      QualityOf(workspace, fit, touches::Residuals(*workspace.observations, prediction)));
  TOUCHSTONE_ASSIGN_OR_RETURN(const double rmse_s, ErrorAsCompared(workspace, model));
  SetError(rmse_s, &quality);
  return quality;
}

engine::Quality QualityWithoutSurface(const Workspace& workspace, const engine::Fit& fit) {
  engine::Quality quality;
  const std::vector<double> left = ResidualsWithoutSurface(workspace, fit);
  const double effective_dof =
      workspace.likelihood->hypotheses()[fit.hypothesis].effective_dof + fit.model.size();
  const touches::SumOfSquares total = touches::TotalSquares(*workspace.searched, left);
  quality.rmse = std::sqrt(total.sum_of_squares / std::max(total.degrees_of_freedom - effective_dof, 1.0));
  quality.heldout_rmse = quality.rmse * HeldOutRatio(fit, engine::HeldOutRmse(workspace.experiment, fit));
  quality.lack_of_fit_p = LackOfFitP(*workspace.searched, left, effective_dof);
  return quality;
}

engine::NoiseFloor NoiseFloorOf(const touches::Observations& o, const std::vector<double>& best,
                                double fitted_parameters) {
  engine::NoiseFloor floor;
  touches::SumOfSquares error = PureErrorOf(o, best);
  floor.from_repeats = HasRepeats(error);
  if (!floor.from_repeats) {
    error = touches::TotalSquares(o, best);
    error.degrees_of_freedom = std::max(error.degrees_of_freedom - fitted_parameters, 1.0);
  }
  floor.degrees_of_freedom = error.degrees_of_freedom;
  if (error.degrees_of_freedom > 0) floor.sigma = std::sqrt(error.sum_of_squares / error.degrees_of_freedom);
  if (const double rounding_s = RoundingS(o); floor.sigma < rounding_s) {
    floor.sigma = rounding_s;
    floor.is_rounding = true;
  } else if (error.degrees_of_freedom >= 1) {
    const auto bound_s = [&](double p) {
      return floor.sigma *
             std::sqrt(error.degrees_of_freedom / ChiSquaredQuantile(p, error.degrees_of_freedom));
    };
    floor.lower = bound_s(0.975);
    floor.upper = bound_s(0.025);
  }
  return floor;
}

}  // namespace touchstone::diagnosis::selection
