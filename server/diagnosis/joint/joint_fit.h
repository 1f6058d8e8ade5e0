// One fit to two kinds of data: the sum of both log likelihoods, each with its own noise, smooth error and floor. A value of
// an effect that both kinds show is one value; every other value concerns the kind whose model has it.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/inference/fit.h"

namespace touchstone::diagnosis::joint {

enum Kind { kTouches = 0, kPhotographs = 1 };
inline constexpr std::array<Kind, 2> kKinds = {kTouches, kPhotographs};

// What one kind of data brings into a joint fit.
struct Part {
  const inference::Experiment* experiment = nullptr;
  inference::Parameterization start;  // with its free values: shared ones, and its own
  // Above 1 where blocks of rows scatter more than their rows say: by how much the variance is larger.
  double variance_factor = 1;
};

struct JointFit {
  // Of each kind at the joint optimum. `covariance` is what that kind alone would give there, `sigma` its own.
  std::array<inference::Fit, 2> fits;
  // Joint values: those of touches, then those that photographs alone have. A free parameter's place among them.
  std::array<std::vector<int>, 2> place;
  std::vector<inference::FreeParameter> parameters;
  Eigen::VectorXd point;
  Eigen::MatrixXd covariance;
  double log_evidence = 0;    // nats, of both kinds; comparable between fits to the same two sets of rows
  double log_likelihood = 0;  // of both at the optimum, averaged over hypotheses of the smooth errors

  // Of one kind's free parameters, from both kinds of data.
  Eigen::MatrixXd CovarianceOf(Kind kind) const;
  // Of one kind's free parameters, from that kind of data alone.
  const Eigen::MatrixXd& AloneOf(Kind kind) const { return fits[kind].covariance; }
  // Where that kind of data alone would have its values, linearly from the joint optimum.
  std::array<Eigen::VectorXd, 2> alone;
};

// Whether the two free parameters, of the two kinds' models, are one value.
bool IsSameValue(const inference::Parameterization& a, int i, const inference::Parameterization& b, int j);

// `tied`: false gives each kind values of its own, for comparison. Errors: CANCELLED, or what a simulator says.
absl::StatusOr<JointFit> FitJointly(const std::array<Part, 2>& parts, bool tied = true);

}  // namespace touchstone::diagnosis::joint
