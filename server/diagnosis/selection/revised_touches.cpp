#include "server/diagnosis/selection/revised_touches.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/selection/rules.h"

namespace touchstone::diagnosis::selection {

void LeaveOutWild(Workspace* workspace) {
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
  const double bound = kSelectionRules.wild * kSigmaOverMedian * used[used.size() / 2];
  std::vector<int> wild;
  for (int k = 0; k < o.size(); ++k)
    if (o.used[k] && bound > 0 && largest[k] > bound) wild.push_back(k);
  if (static_cast<double>(wild.size()) >
      std::max(1.0, kSelectionRules.few_wild * static_cast<double>(used.size())))
    return;
  for (const int k : wild) touches::LeaveOut(&o, k, touches::kOutlierReason);
}

void LeaveOutRows(const GroupDifference& group, touches::Observations* o) {
  std::vector<char> leaves(o->set->size(), 0);
  for (const int row : group.rows) leaves[row] = 1;
  for (int k = 0; k < o->size(); ++k)
    if (leaves[o->row[k]]) touches::LeaveOut(o, k, absl::StrCat(group.part, ", where something was other"));
}

absl::StatusOr<bool> ReviseTouches(const SelectionResult& found, const std::vector<int>& outliers,
                                   Workspace* workspace, std::vector<double>* weights) {
  touches::Observations& o = *workspace->observations;
  const touches::NoiseFindings& noise = found.noise;
  TOUCHSTONE_ASSIGN_OR_RETURN(const int edges,
                              LeaveOutEdges(*workspace->predictor, found.fit.model.base(), &o));
  const bool reweigh = weights->empty() && !noise.weights.empty();
  if (edges == 0 && outliers.empty() && !reweigh) return false;
  for (const int k : outliers) touches::LeaveOut(&o, k, touches::kOutlierReason);
  weights->clear();
  if (noise.weights.empty()) return true;
  weights->assign(o.set->size(), 1.0);
  for (int k = 0; k < o.size(); ++k) (*weights)[o.row[k]] = noise.weights[k];
  return true;
}

}  // namespace touchstone::diagnosis::selection
