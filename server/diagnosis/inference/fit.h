// Fitting values of a model to the observations: Gauss-Newton with the simulator in the loop, under the
// likelihood with a surface error, and the evidence for the fitted model.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/inference/free_model.h"
#include "server/diagnosis/inference/judgement.h"
#include "server/diagnosis/inference/likelihood.h"
#include "server/diagnosis/touches/contrasts.h"
#include "server/diagnosis/touches/predictor.h"

namespace touchstone {

// What is fitted to: shared by all fits of a diagnosis.
struct Experiment {
  const Observations* observations = nullptr;
  const Predictor* predictor = nullptr;
  const Contrasts* contrasts = nullptr;
  const Likelihood* likelihood = nullptr;
  std::vector<double> nominal_s;  // the given model's times: stand in where another model misses
  ThreadPool* pool = nullptr;     // for columns; null: this thread
  std::function<bool()> cancelled;
};

struct Fit {
  FreeModel model;              // its base stands at the optimum
  Eigen::VectorXd point;        // the optimum
  Likelihood::Columns columns;  // [residual | one derivative a coordinate], contrasts
  std::vector<double> time_s;   // predicted
  double evidence = 0;          // nats; comparable between models of one experiment
  double log_likelihood = 0;    // maximum over values, averaged over hypotheses of the surface
  int surface = 0;              // most probable hypothesis
  double sigma_s = 0;
  Eigen::MatrixXd covariance;  // of the coordinates
};

// Contrasts of measured minus predicted.
Eigen::VectorXd ResidualContrasts(const Experiment& experiment, const std::vector<double>& predicted_s);

absl::StatusOr<std::vector<double>> PredictTimes(const Experiment& experiment, const Model& model);

// Derivatives of the predicted contrasts by coordinates first .. size of `model` at `point`; `at_s` are the
// times predicted there. Entries where a finger's contact jumps to another face within the step are zero.
absl::StatusOr<Eigen::MatrixXd> Derivatives(const Experiment& experiment, const FreeModel& model,
                                            const Eigen::VectorXd& point, const std::vector<double>& at_s,
                                            int first);

// `max_iterations` 0 only judges the start.
inline constexpr int kMaxIterations = 10;
absl::StatusOr<Fit> FitModel(const Experiment& experiment, FreeModel start,
                             int max_iterations = kMaxIterations);

}  // namespace touchstone
