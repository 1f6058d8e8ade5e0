// One fit to several kinds of measurement: the sum of their log likelihoods, each with its own noise, smooth error and floor.
// A value of an effect that several kinds show is one value; every other value concerns the kind whose model has it.
#pragma once

#include <functional>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/engine/fit/fit.h"

namespace touchstone::diagnosis::joint {

// What one kind of data brings into a joint fit.
struct Part {
  const engine::Experiment* experiment = nullptr;
  engine::Parameterization start;  // with its free values: shared ones, and its own
  // Above 1 where blocks of rows scatter more than their rows say: by how much the variance is larger.
  double variance_factor = 1;
};

struct JointFit {
  // Of each kind at the joint optimum. `covariance` is what that kind alone would give there, `sigma` its own.
  std::vector<engine::Fit> fits;
  // Joint values: those of the first kind, then those that only later ones have. A free parameter's place among them.
  std::vector<std::vector<int>> place;
  std::vector<engine::FreeParameter> parameters;
  Eigen::VectorXd point;
  Eigen::MatrixXd covariance;
  double log_evidence = 0;    // nats, of all kinds; comparable between fits to the same rows
  double log_likelihood = 0;  // of all at the optimum, averaged over hypotheses of the smooth errors
  // Where each kind's data alone would have its values, linearly from the joint optimum.
  std::vector<Eigen::VectorXd> alone;

  // Of one kind's free parameters, from all data.
  Eigen::MatrixXd CovarianceOf(int kind) const;
  // Of one kind's free parameters, from that kind of data alone.
  const Eigen::MatrixXd& AloneOf(int kind) const { return fits[kind].covariance; }
};

// Whether the two free parameters, of two kinds' models, are one value.
bool IsSameValue(const engine::Parameterization& a, int i, const engine::Parameterization& b, int j);

// Whether a kind has its own value of a free parameter that other kinds have too.
using HasOwnValue = std::function<bool(const engine::Parameterization& model, int parameter)>;

// Errors: CANCELLED, or what a simulator says.
absl::StatusOr<JointFit> FitJointly(const std::vector<Part>& parts, const HasOwnValue& has_own = nullptr);

}  // namespace touchstone::diagnosis::joint
