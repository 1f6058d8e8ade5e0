#include "server/diagnosis/touches/noise/noise_likelihood.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/touches/noise/golden_section.h"
#include "server/diagnosis/touches/noise/rules.h"

namespace touchstone::diagnosis::touches {
namespace {

constexpr int kNodes = 20;  // per reading, of the integral over the common shift
const double kLogTwoPi = std::log(2 * kPi);

double LogGaussian(const ReadingGroup& group, const NoiseModel& model) {
  double weights = 0, first = 0, second = 0, logs = 0;
  for (size_t i = 0; i < group.residual_s.size(); ++i) {
    const double s = model.sigma_s * RelativeScale(group, i, model);
    const double w = 1 / (s * s);
    weights += w;
    first += w * group.residual_s[i];
    second += w * group.residual_s[i] * group.residual_s[i];
    logs -= 0.5 * kLogTwoPi + std::log(s);
  }
  return logs + 0.5 * (kLogTwoPi - std::log(weights)) - 0.5 * (second - first * first / weights);
}

// Density of one group's readings in units of their scales: a product, with one logarithm for all of them.
class Density {
 public:
  explicit Density(const NoiseModel& model) : model_(model) {
    const double nu = model.degrees_of_freedom;
    if (model.shape == NoiseShape::kStudent)
      log_constant_ = std::lgamma((nu + 1) / 2) - std::lgamma(nu / 2) - 0.5 * std::log(nu * kPi);
  }
  // The square of each reading's deviation in turn.
  void Begin() { product_ = 1; }
  void Multiply(double square) {
    if (model_.shape == NoiseShape::kStudent) {
      product_ *= 1 + square / model_.degrees_of_freedom;
      return;
    }
    const double narrow = std::exp(-0.5 * square);
    const double density =
        model_.shape == NoiseShape::kGaussian
            ? narrow
            : (1 - model_.share) * narrow +
                  model_.share / model_.width * std::exp(-0.5 * square / (model_.width * model_.width));
    product_ *= density / std::sqrt(2 * kPi);
  }
  double Product(int readings) const {
    if (model_.shape != NoiseShape::kStudent) return product_;
    return std::exp(readings * log_constant_ - 0.5 * (model_.degrees_of_freedom + 1) * std::log(product_));
  }

 private:
  const NoiseModel& model_;
  double log_constant_ = 0;
  double product_ = 1;
};

// Importance quadrature: shifts are placed by Cauchy distributions round every finger, so that no mode of the
// integrand is missed, however far an outlier lies.
double LogIntegrated(const ReadingGroup& group, const NoiseModel& model, Density* density,
                     const std::array<double, kNodes>& tangents) {
  const int n = static_cast<int>(group.residual_s.size());
  double scale[16], logs = 0;
  for (int i = 0; i < n; ++i) {
    scale[i] = model.sigma_s * RelativeScale(group, i, model);
    logs -= std::log(scale[i]);
  }
  double sum = 0;
  for (int j = 0; j < n; ++j) {
    for (const double tangent : tangents) {
      const double shift = group.residual_s[j] + scale[j] * tangent;
      double proposal = 0;
      density->Begin();
      for (int i = 0; i < n; ++i) {
        const double x = (group.residual_s[i] - shift) / scale[i];
        density->Multiply(x * x);
        proposal += 1 / (kPi * scale[i] * (1 + x * x));
      }
      sum += density->Product(n) / proposal;
    }
  }
  return logs + std::log(std::max(sum / kNodes, 1e-300));
}

}  // namespace

double RelativeScale(const ReadingGroup& group, size_t i, const NoiseModel& model) {
  double scale = 1 + model.slope * group.growth[i];
  if (!model.channel_scale.empty()) scale *= model.channel_scale[group.channel[i]];
  if (model.length_share > 0)
    scale *= std::sqrt(1 - model.length_share + model.length_share * group.slowness * group.slowness);
  return scale;
}

bool SpeedsDiffer(const std::vector<ReadingGroup>& groups) {
  const auto [low, high] = std::minmax_element(
      groups.begin(), groups.end(), [](const auto& a, const auto& b) { return a.slowness < b.slowness; });
  return high->slowness > kNoiseRules.min_slowness_spread * low->slowness;
}

double NoiseLogLikelihood(const std::vector<ReadingGroup>& groups, const NoiseModel& model) {
  double sum = 0;
  if (model.shape == NoiseShape::kGaussian) {
    for (const ReadingGroup& group : groups) sum += LogGaussian(group, model);
    return sum;
  }
  Density density(model);
  std::array<double, kNodes> tangents;
  for (int m = 0; m < kNodes; ++m) tangents[m] = std::tan(kPi * ((m + 0.5) / kNodes - 0.5));
  for (const ReadingGroup& group : groups) sum += LogIntegrated(group, model, &density, tangents);
  return sum;
}

double ProfileSigma(const std::vector<ReadingGroup>& groups, NoiseModel* model) {
  if (model->shape == NoiseShape::kGaussian) {
    // Closed form: the quadratic form over its degrees of freedom.
    double squares = 0, degrees = 0;
    for (const ReadingGroup& group : groups) {
      double weights = 0, first = 0, second = 0;
      for (size_t i = 0; i < group.residual_s.size(); ++i) {
        const double s = RelativeScale(group, i, *model);
        weights += 1 / (s * s);
        first += group.residual_s[i] / (s * s);
        second += group.residual_s[i] * group.residual_s[i] / (s * s);
      }
      squares += second - first * first / weights;
      degrees += static_cast<double>(group.residual_s.size()) - 1;
    }
    model->sigma_s = std::sqrt(std::max(squares / std::max(degrees, 1.0), 1e-24));
    return NoiseLogLikelihood(groups, *model);
  }
  const auto value = [&](double log_sigma) {
    NoiseModel at = *model;
    at.sigma_s = std::exp(log_sigma);
    return NoiseLogLikelihood(groups, at);
  };
  const double from = std::log(model->sigma_s);
  double max = 0;
  model->sigma_s = std::exp(Maximise(value, from - 1.5, from + 0.5, kNoiseRules.sigma_steps, &max));
  return max;
}

double OutlierProbability(const ReadingGroup& group, const NoiseModel& model) {
  NoiseModel narrow = model;
  narrow.shape = NoiseShape::kGaussian;
  const double n = static_cast<double>(group.residual_s.size());
  const double clean = NoiseLogLikelihood({group}, narrow) + n * std::log(1 - model.share);
  return 1 - std::min(1.0, std::exp(clean - NoiseLogLikelihood({group}, model)));
}

}  // namespace touchstone::diagnosis::touches
