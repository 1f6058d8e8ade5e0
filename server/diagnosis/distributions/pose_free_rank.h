// How unusual a set without poses is among sets that a model makes, and the poses that suit it best.
#pragma once

#include "server/diagnosis/distributions/pose_free_experiment.h"

namespace touchstone {

// p of `measured` among values of simulated sets in the order in which they were made: of the k-th that is at
// least as large, k / its place; if there are fewer than k, (1 + as large) / (1 + all). Exact although one
// stops making sets at the k-th (Besag and Clifford 1991).
double SequentialP(const std::vector<double>& simulated, double measured, int k);

// The rank of the measured set among sets that a model makes.
class UnposedRank {
 public:
  // `doubt_only`: sets are made until it is clear whether p is above 0.1, no more. `from` and `to`: progress.
  // Returns CANCELLED if progress says so.
  static absl::StatusOr<UnposedRank> Make(const UnposedCase& the_case,
                                          const std::shared_ptr<const Model>& model,
                                          const SupposedPoses& poses, bool doubt_only, double from,
                                          double to);

  // Of all measures together.
  double p() const { return p_; }
  const SupposedPoses& poses() const { return poses_; }
  const UnposedSamples& reference() const { return reference_; }
  const std::vector<double>& distances() const { return distances_; }  // of the measured set
  // Of the object, or of all together: the number of objects.
  UnposedNull Null(size_t object) const;

 private:
  SupposedPoses poses_;
  UnposedSamples reference_;
  std::vector<double> distances_;
  std::vector<std::vector<std::vector<double>>> sets_;  // [set][object; the last: all][measure]
  double p_ = 1;
};

// The poses under which the model's sets are most like the measured one, from `rank`'s: what another tilt or
// spread explains is no error of the model. That makes p too large rather than too small.
absl::StatusOr<SupposedPoses> FitPoses(const UnposedCase& the_case, const UnposedRank& rank, double from,
                                       double to);

}  // namespace touchstone
