// Likelihood of residuals under kinds of noise that are independent from reading to reading. The readings of a group
// (a touch) are known up to a common shift only, so the density is integrated over that shift:
//   p(residuals) = integral over m of prod_i f((r_i - m) / s_i) / s_i
#pragma once

#include <vector>

namespace touchstone::diagnosis::touches {

// Readings that share an unknown shift: the fingers of one touch that report.
struct ReadingGroup {
  int index = 0;  // of the touch
  std::vector<double> residual_s;
  std::vector<double> growth;  // what the noise may grow with: tan of the incidence
  std::vector<int> channel;    // of each reading: the finger
  double slowness = 1;  // seconds per metre over their root mean square: what a noise of lengths grows with
};

enum class NoiseShape { kGaussian, kStudent, kMixture };

struct NoiseModel {
  NoiseShape shape = NoiseShape::kGaussian;
  double sigma_s = 0;
  // Scale of reading i: sigma (1 + slope growth_i) channel_scale_i sqrt(1 - w + w slowness^2), w = length_share.
  double slope = 0;
  std::vector<double> channel_scale;  // by channel; empty: 1
  double length_share = 0;            // of the variance that is a noise of lengths, 0 to 1
  double degrees_of_freedom = 0;      // of Student's t
  double share = 0;                   // of outliers in the mixture,
  double width = 0;                   // and their sigma over the others'
};

// Scale of reading i of a group over sigma.
double RelativeScale(const ReadingGroup& group, size_t i, const NoiseModel& model);

// Whether the touches' speeds differ by so much that a noise of lengths can be told from one of times. `groups`: at least one.
bool SpeedsDiffer(const std::vector<ReadingGroup>& groups);

double NoiseLogLikelihood(const std::vector<ReadingGroup>& groups, const NoiseModel& model);

// The same with the best sigma near model.sigma_s, which is set.
double ProfileSigma(const std::vector<ReadingGroup>& groups, NoiseModel* model);

// Probability that a reading of the group is an outlier, under a mixture.
double OutlierProbability(const ReadingGroup& group, const NoiseModel& model);

}  // namespace touchstone::diagnosis::touches
