// What is reported of a set without poses besides the test: which rows are compared, the noise that rounds
// show, statistics and histograms beside the model's, the plan that is assumed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/distributions/pose_free_rank.h"
#include "server/diagnosis/residuals/distribution/histogram_bins.h"

namespace touchstone::diagnosis::distributions {

// Every row of the set is compared, incomplete or thinned out.
struct PoseFreeRows {
  int compared = 0;                           // touches with a time of every finger
  int incomplete = 0;                         // touches in which a finger reported nothing
  std::vector<uint64_t> incomplete_examples;  // their numbers in the file, at most five
  int thinned = 0;                            // more than the comparison needs: left out by whole poses
  int missed_contacts = 0;                    // fingers that reported nothing, in the touches not thinned out
  int rounds = 0;                             // 0: the set does not go in rounds
};

// Noise of one finger's time from the scatter among rounds, with its 95 % interval.
struct RoundNoise {
  double sigma_s = 0, std_error_s = 0;
  double lower_s = 0, upper_s = 0;
  double degrees_of_freedom = 0;
};

// A number that people can picture, averaged over all touches; objects weigh on both sides as in the set.
struct StatisticComparison {
  std::string name, unit;  // of the two means: "us", "1/m", or empty for a share
  double measured = 0, simulated = 0;
  double p_value = 1;  // of the Kolmogorov distance between the two samples
};

PoseFreeRows CountRows(const PoseFreeExperiment& experiment);
// Empty without rounds, or with too few of them.
std::optional<RoundNoise> NoiseOfRounds(const PoseFreeExperiment& experiment);
std::vector<StatisticComparison> CompareStatistics(const PoseFreeExperiment& experiment,
                                                   const PoseFreeRank& rank);
// Descriptors and, with three fingers, curvatures: over all objects and object by object. The simulated
// sample is the reference; the improved one is the same.
std::vector<residuals::ComparedHistogram> ComparePoseFreeHistograms(const PoseFreeExperiment& experiment,
                                                                    const PoseFreeRank& rank);
// "faces of the bounding box, 8 poses per face, ..."; `fitted`: the poses are those that fit best.
std::string PlanInWords(const PoseFreeExperiment& experiment, const AssumedPoses& poses, bool fitted);

}  // namespace touchstone::diagnosis::distributions
