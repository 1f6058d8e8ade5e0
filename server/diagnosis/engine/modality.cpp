#include "server/diagnosis/engine/modality.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/held_out.h"

namespace touchstone::diagnosis::engine {

double HeldOutError::Of(double rmse) const {
  return std::sqrt(ratio * ratio * rmse * rmse + excess_squares);
}

absl::StatusOr<HeldOutError> Modality::HeldOut(const Fit& /*searched*/, const Fit& final) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const double unseen, HeldOutRmseRefitted(experiment(), final));
  const double seen = std::sqrt(final.columns.values.col(0).squaredNorm() /
                                std::max<double>(1, static_cast<double>(final.columns.values.rows())));
  HeldOutError error;
  if (seen > 0) error.ratio = std::max(unseen / seen, 1.0);
  return error;
}

std::optional<NothingMissing> NothingMissingOf(const std::vector<const Modality*>& modalities) {
  std::vector<const TriedPValues*> kinds;
  for (const Modality* modality : modalities) kinds.push_back(&modality->tried());
  return WorstOfKinds(kinds);
}

}  // namespace touchstone::diagnosis::engine
