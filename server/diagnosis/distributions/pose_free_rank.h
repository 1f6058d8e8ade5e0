// Monte Carlo test of a set without poses: its rank among sets that a model makes; and the poses that suit it
// best.
#pragma once

#include "server/diagnosis/distributions/pose_free_experiment.h"

namespace touchstone::diagnosis::distributions {

// p of `measured` among the values of simulated sets, in the order in which they were made: if the k-th that
// is at least as large stands at place m, k / m; with fewer than k of them, (1 + number as large) / (1 +
// number). Exact although no more sets are made after the k-th (Besag and Clifford 1991).
double SequentialP(const std::vector<double>& simulated, double measured, int k);

// The rank of the measured set among sets that a model makes.
class PoseFreeRank {
 public:
  // `coarse`: sets are made only until it is clear whether p is above 0.1. `from` and `to`: the part of the
  // progress that this takes. Returns CANCELLED if the progress callback says so.
  static absl::StatusOr<PoseFreeRank> Make(const PoseFreeExperiment& experiment,
                                           const std::shared_ptr<const model::Model>& model,
                                           const AssumedPoses& poses, bool coarse, double from, double to);

  // p of all distance measures together.
  double p() const { return p_; }
  const AssumedPoses& poses() const { return poses_; }
  const PoseFreeSamples& reference() const { return reference_; }
  const std::vector<double>& distances() const { return distances_; }  // of the measured set
  // The null distribution of one object, or, with the number of objects, of all together.
  PoseFreeNull Null(size_t object) const;

 private:
  AssumedPoses poses_;
  PoseFreeSamples reference_;
  std::vector<double> distances_;
  std::vector<std::vector<std::vector<double>>> sets_;  // [set][object; the last: all][measure]
  double p_ = 1;
};

// The poses under which the model's sets are most like the measured one, starting from those of `rank`: what
// another tilt or spread explains is no error of the model. That makes p too large rather than too small.
absl::StatusOr<AssumedPoses> FitPoses(const PoseFreeExperiment& experiment, const PoseFreeRank& rank,
                                      double from, double to);

}  // namespace touchstone::diagnosis::distributions
