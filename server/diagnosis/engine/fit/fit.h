// Fitting free parameters to the rows: Gauss-Newton with the simulator in the loop, under the likelihood with a smooth
// error, and the evidence for the fitted model.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"
#include "server/diagnosis/engine/fit/likelihood.h"
#include "server/diagnosis/engine/fit/observation_model.h"
#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/engine/fit/rules.h"

namespace touchstone::diagnosis::engine {

// What is fitted to: shared by all fits of a diagnosis.
struct Experiment {
  const ObservationModel* observations = nullptr;
  const Likelihood* likelihood = nullptr;
  ThreadPool* pool = nullptr;  // for columns; null: this thread
  std::function<bool()> cancelled;
  // Effects of the model, by name, whose values another experiment has settled: a search does not set them free.
  std::vector<std::string> settled;
  // Standard errors: a fit ends where no value has farther to go; 0: by its likelihood alone.
  double near_enough = 0;
  // Derivatives are updated by what the last step really changed (Broyden, A class of methods for solving nonlinear
  // simultaneous equations, 1965), and simulated again only where that leads no further: for searches whose rows take long
  // to simulate.
  bool update_derivatives = false;
};

struct Fit {
  Parameterization model;         // its base stands at the optimum
  Eigen::VectorXd point;          // the optimum
  Likelihood::Columns columns;    // rows: [residual | one derivative per free parameter]
  std::vector<double> predicted;  // of ObservationModel::Predict at the optimum
  double log_evidence = 0;        // nats; comparable between models of one experiment
  double log_likelihood = 0;      // maximum over values, averaged over hypotheses of the smooth error
  int hypothesis = 0;             // the most probable one
  double sigma = 0;               // noise, in the unit of the rows
  Eigen::MatrixXd covariance;     // of the free parameters
};

// Derivatives of the predicted rows by free parameters first .. size of `model` at `point`; `predicted` is the
// prediction there. Error: CANCELLED, or what the simulator says.
absl::StatusOr<Eigen::MatrixXd> Derivatives(const Experiment& experiment, const Parameterization& model,
                                            const Eigen::VectorXd& point,
                                            const std::vector<double>& predicted, int first);

// `max_iterations` 0 only evaluates the start. `part`: a fit of the first parameters of `start`, if any is known; where
// derivatives are updated and the others change nothing at the start, its derivatives are taken over.
absl::StatusOr<Fit> FitModel(const Experiment& experiment, Parameterization start,
                             int max_iterations = kFitRules.max_iterations, const Fit* part = nullptr);

}  // namespace touchstone::diagnosis::engine
