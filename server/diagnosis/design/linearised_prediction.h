// What a fitted model predicts for touches that were not made yet, and how that prediction moves when the
// model is fitted again to them: to first order around its present values.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::design {

// Times are less their mean over the fingers, in standard deviations of the noise. Free parameters are
// counted in their scales, so that each has a prior of width 1.
struct LinearisedPrediction {
  std::vector<Eigen::VectorXd> predicted;   // [candidate], a time per finger; NaN where a finger misses
  std::vector<Eigen::MatrixXd> derivative;  // [candidate], fingers x free parameters
  Eigen::MatrixXd covariance;               // of the free parameters, from the present data and their priors
};

// Every value of every effect is free. weight: how many touches of the present data one of `present` stands
// for.
absl::StatusOr<LinearisedPrediction> Linearise(const model::Model& model,
                                               const touches::Observations& present, double weight,
                                               const touches::Observations& candidates, double sigma_s,
                                               ThreadPool* pool);

// One model that is fitted again and again to what another one would measure: recursive least squares, exact
// for what is linear. Both predictions must outlive it.
class SequentialRefit {
 public:
  SequentialRefit(const LinearisedPrediction* fitted, const LinearisedPrediction* truth);

  // How much worse than the truth the best fit becomes with candidate k, in squared sigmas; 0 where either
  // misses.
  double Gain(int k) const;
  // What candidate k teaches about the fitted model's values: log determinant, nats.
  double InformationNats(int k) const;
  // Standard deviation that the fitted model's values leave open about candidate k, sigmas.
  double PredictionSigmas(int k) const;
  // Adds candidate k to the data.
  void Add(int k);
  // The sum of the gains of the candidates that were added.
  double separation() const { return separation_; }

 private:
  Eigen::VectorXd Surprise(int k) const;                   // truth less the present fit
  Eigen::MatrixXd Spread(const Eigen::MatrixXd& g) const;  // covariance of the surprise

  const LinearisedPrediction* fitted_;
  const LinearisedPrediction* truth_;
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd moved_;  // the fitted model's values, from where they started
  double separation_ = 0;
};

}  // namespace touchstone::diagnosis::design
