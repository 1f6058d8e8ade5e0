#include "server/diagnosis/selection/revised_touches.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/selection/quality.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kUnpredictedP = 1e-4;  // of their error over that of the touches that the fit used

// Touches that left for the place that the given model gives them, and that a comparison with `fit` uses.
absl::StatusOr<std::vector<int>> TouchesElsewhere(const engine::Fit& fit,
                                                  const touches::Prediction& prediction,
                                                  const Workspace& workspace) {
  const touches::Observations& o = *workspace.observations;
  std::vector<int> elsewhere;
  for (const char* reason : {touches::kMissedReason, touches::kEdgeReason})
    for (const int k : touches::LeftOutFor(o, reason)) elsewhere.push_back(k);
  if (elsewhere.empty()) return elsewhere;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations usable,
                              UsableUnder(workspace, fit.model.base(), prediction, workspace.comparable));
  elsewhere.erase(
      std::remove_if(elsewhere.begin(), elsewhere.end(), [&](const int k) { return !usable.used[k]; }),
      elsewhere.end());
  return elsewhere;
}

// No fit has seen what they say; what it predicts well it need not see.
absl::StatusOr<bool> TakeBackUnpredicted(const engine::Fit& fit, Workspace* workspace) {
  touches::Observations& o = *workspace->observations;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                              workspace->predictor->Run(fit.model.base(), false, false));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int> elsewhere,
                              TouchesElsewhere(fit, prediction, *workspace));
  if (elsewhere.empty()) return false;
  const std::vector<double> residuals = touches::Residuals(o, prediction);
  const touches::SumOfSquares used = touches::TotalSquares(o, residuals);
  touches::Observations others = o;
  std::fill(others.used.begin(), others.used.end(), 0);
  for (const int k : elsewhere) others.used[k] = 1;
  const touches::SumOfSquares unseen = touches::TotalSquares(others, residuals);
  if (!(used.sum_of_squares > 0) || !(unseen.degrees_of_freedom > 0)) return false;
  const double ratio =
      unseen.sum_of_squares / unseen.degrees_of_freedom / (used.sum_of_squares / used.degrees_of_freedom);
  if (FisherTail(ratio, unseen.degrees_of_freedom, used.degrees_of_freedom) > kUnpredictedP) return false;
  for (const int k : elsewhere)
    for (const char* reason : {touches::kMissedReason, touches::kEdgeReason})
      touches::TakeBack(&o, k, reason);
  return true;
}

}  // namespace

// A few touches that are so far from the given model that beside them nothing else would show.
void LeaveOutWild(Workspace* workspace) {
  constexpr double kWild = 100;  // robust standard deviations
  constexpr double kFewShare = 0.005;
  constexpr double kSigmaOverMedian = 1.4826;
  touches::Observations& o = *workspace->observations;
  const std::vector<double> residuals = touches::Residuals(o, workspace->nominal);
  std::vector<double> largest(o.size(), 0), used;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    for (int i = 0; i < o.fingers; ++i)
      if (const double r = std::abs(residuals[static_cast<size_t>(k) * o.fingers + i]); !std::isnan(r))
        largest[k] = std::max(largest[k], r);
    used.push_back(largest[k]);
  }
  if (used.empty()) return;
  std::nth_element(used.begin(), used.begin() + static_cast<long>(used.size() / 2), used.end());
  const double bound = kWild * kSigmaOverMedian * used[used.size() / 2];
  std::vector<int> wild;
  for (int k = 0; k < o.size(); ++k)
    if (o.used[k] && bound > 0 && largest[k] > bound) wild.push_back(k);
  if (static_cast<double>(wild.size()) > std::max(1.0, kFewShare * static_cast<double>(used.size()))) return;
  for (const int k : wild) touches::LeaveOut(&o, k, touches::kOutlierReason);
}

// What a part of the session has for itself says nothing of the rest.
void LeaveOutRows(const GroupDifference& group, touches::Observations* o) {
  std::vector<char> leaves(o->set->size(), 0);
  for (const int row : group.rows) leaves[row] = 1;
  for (int k = 0; k < o->size(); ++k)
    if (leaves[o->row[k]]) touches::LeaveOut(o, k, absl::StrCat(group.part, ", where something was other"));
}

absl::StatusOr<bool> ReviseTouches(const engine::Fit& fit, const touches::NoiseFindings& noise,
                                   const std::vector<int>& outliers, Workspace* workspace,
                                   std::vector<double>* weights) {
  touches::Observations& o = *workspace->observations;
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool taken_back, TakeBackUnpredicted(fit, workspace));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int edges, LeaveOutEdges(*workspace->predictor, fit.model.base(), &o));
  const bool reweigh = weights->empty() && !noise.weights.empty();
  if (!taken_back && edges == 0 && outliers.empty() && !reweigh) return false;
  for (const int k : outliers) touches::LeaveOut(&o, k, touches::kOutlierReason);
  weights->clear();
  if (noise.weights.empty()) return true;
  weights->assign(o.set->size(), 1.0);
  for (int k = 0; k < o.size(); ++k) (*weights)[o.row[k]] = noise.weights[k];
  return true;
}

}  // namespace touchstone::diagnosis::selection
