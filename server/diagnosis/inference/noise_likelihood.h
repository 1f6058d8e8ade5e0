// Likelihood of residuals under kinds of noise that are independent from finger to finger. A touch's times
// are known up to a common shift only, so the density is integrated over that shift:
//   p(residuals) = integral over m of prod_i f((r_i - m) / s_i) / s_i
#pragma once

#include <vector>

namespace touchstone {

// What one touch contributes.
struct NoisyTouch {
  int k = 0;
  std::vector<double> residual_s;
  std::vector<double> tangent;  // of the incidence
};

enum class NoiseShape { kGaussian, kStudent, kMixture };

struct NoiseModel {
  NoiseShape shape = NoiseShape::kGaussian;
  double sigma_s = 0;
  double slope = 0;    // s_i = sigma (1 + slope tan(inc_i))
  double degrees = 0;  // of freedom of Student's t
  double share = 0;    // of outliers in the mixture,
  double width = 0;    // and their sigma over the others'
};

double NoiseLogLikelihood(const std::vector<NoisyTouch>& touches, const NoiseModel& model);

// The same with the best sigma near model.sigma_s, which is set.
double ProfileSigma(const std::vector<NoisyTouch>& touches, NoiseModel* model);

// Probability that a finger of the touch is an outlier, under a mixture.
double OutlierProbability(const NoisyTouch& touch, const NoiseModel& model);

}  // namespace touchstone
