#include "server/diagnosis/design/linearised_prediction.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::design {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

// Times of touch k less their mean, in sigmas.
Vector Centred(const std::vector<double>& time_s, int k, int fingers, double sigma_s) {
  Vector t = Eigen::Map<const Vector>(&time_s[size_t(k) * fingers], fingers);
  return (t.array() - t.mean()).matrix() / sigma_s;
}

// Derivatives of every touch by all free parameters, [touch] fingers x parameters; those that are not finite
// are 0.
absl::StatusOr<std::vector<Matrix>> DerivativesOf(const touches::Observations& observations,
                                                  const engine::Parameterization& free,
                                                  const std::vector<double>& at_start_s, double sigma_s,
                                                  ThreadPool* pool) {
  const int fingers = observations.fingers;
  std::vector<Matrix> columns(observations.size(), Matrix::Zero(fingers, free.size()));
  const Vector start = free.Start();
  for (int c = 0; c < free.size(); ++c) {
    const engine::FreeParameter& coordinate = free.parameters()[c];
    double step = engine::kFitRules.derivative_step * coordinate.scale;
    if (start[c] + step > coordinate.upper) step = -step;
    Vector point = start;
    point[c] += step;
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction moved,
                                touches::Predict(observations, free.At(point), false, false, pool));
    for (int k = 0; k < observations.size(); ++k) {
      const Vector change =
          Centred(moved.time_s, k, fingers, sigma_s) - Centred(at_start_s, k, fingers, sigma_s);
      if (change.allFinite() && change.cwiseAbs().maxCoeff() < kDesignRules.max_derivative_sigmas)
        columns[k].col(c) = change * (coordinate.scale / step);
    }
  }
  return columns;
}

}  // namespace

absl::StatusOr<LinearisedPrediction> Linearise(const model::Model& model,
                                               const touches::Observations& present, double weight,
                                               const touches::Observations& candidates, double sigma_s,
                                               ThreadPool* pool) {
  engine::Parameterization free(model, present.objects);
  for (size_t e = 0; e < model.effects.size(); ++e) free.Free(static_cast<int>(e), true);
  LinearisedPrediction result;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction now,
                              touches::Predict(present, model, false, false, pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Matrix> known,
                              DerivativesOf(present, free, now.time_s, sigma_s, pool));
  Matrix information = Matrix::Identity(free.size(), free.size());  // the priors'
  for (int k = 0; k < present.size(); ++k)
    if (present.used[k]) information += weight * known[k].transpose() * known[k];
  result.covariance = information.llt().solve(Matrix::Identity(free.size(), free.size()));

  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction next,
                              touches::Predict(candidates, model, false, false, pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(result.derivative, DerivativesOf(candidates, free, next.time_s, sigma_s, pool));
  for (int k = 0; k < candidates.size(); ++k)
    result.predicted.push_back(Centred(next.time_s, k, candidates.fingers, sigma_s));
  return result;
}

SequentialRefit::SequentialRefit(const LinearisedPrediction* fitted, const LinearisedPrediction* truth)
    : fitted_(fitted),
      truth_(truth),
      covariance_(fitted->covariance),
      moved_(Vector::Zero(covariance_.rows())) {}

Vector SequentialRefit::Surprise(int k) const {
  return truth_->predicted[k] - fitted_->predicted[k] - fitted_->derivative[k] * moved_;
}

Matrix SequentialRefit::Spread(const Matrix& g) const {
  return Matrix::Identity(g.rows(), g.rows()) + g * covariance_ * g.transpose();
}

double SequentialRefit::Gain(int k) const {
  const Vector surprise = Surprise(k);
  if (!surprise.allFinite()) return 0;
  return surprise.dot(Spread(fitted_->derivative[k]).llt().solve(surprise));
}

double SequentialRefit::InformationNats(int k) const {
  return std::log(Spread(fitted_->derivative[k]).llt().matrixL().determinant());
}

double SequentialRefit::PredictionSigmas(int k) const {
  const Matrix& g = fitted_->derivative[k];
  return std::sqrt(std::max(0.0, Spread(g).trace() - g.rows()));
}

void SequentialRefit::Add(int k) {
  separation_ += Gain(k);
  const Matrix& g = fitted_->derivative[k];
  const Vector surprise = Surprise(k);
  const Matrix gain =
      covariance_ * g.transpose() * Spread(g).llt().solve(Matrix::Identity(g.rows(), g.rows()));
  moved_ += gain * surprise;
  covariance_ -= gain * g * covariance_;
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
}

}  // namespace touchstone::diagnosis::design
