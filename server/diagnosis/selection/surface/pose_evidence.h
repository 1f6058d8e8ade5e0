// Residuals pose by pose, and how well a smooth function of something that readings have (their place, a covariate)
// explains them beside errors that differ from pose to pose at random: the nugget. A pose is one row each of its means,
// all of one weight, so what every pose has for itself counts as scatter and not as structure.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis::selection {

// One pose with one set of reporting fingers: the mean of its repeats.
struct PoseMean {
  int touch = 0;  // of the contrasts: the first of the repeats
  int object = 0, pose = 0;
  Eigen::MatrixXd mean;   // contrasts x columns: the residual, s, then derivatives by the fit's parameters
  double weight = 0;      // sum of the repeats' weights
  double scatter_s2 = 0;  // of the residual: sum of squares about the mean
  int repeats = 0;
};

struct PoseFunction {
  std::string name;
  bool by_object = false;  // groups: objects, else all in one
  // The coordinate of reading e = k * fingers + i of an object.
  std::function<Eigen::Vector3d(size_t e, int finger, int object)> place;
  bool along_normal = false;  // a departure of the surface along its normal, else a change of the travel
  double size = 0;            // range of the coordinates
  std::vector<Eigen::Vector3d> knots;  // places that stand for all; empty: the places themselves
};

class PoseEvidence {
 public:
  // `details`: of the fit's model, on the touches of the search. Both and the workspace must outlive it.
  PoseEvidence(const Workspace& workspace, const engine::Fit& fit, const touches::Prediction& details);

  const std::vector<PoseMean>& means() const { return means_; }  // object by object
  const Eigen::MatrixXd& values() const { return values_; }  // the poses' contrasts, in the order of means()
  std::vector<int> FirstRows(bool by_object) const;
  engine::SmoothErrorGeometry GeometryOf(const PoseFunction& function) const;
  engine::Likelihood LikelihoodOf(const PoseFunction& function) const;

  // Log evidence of any such function over none, nats; `best`: the most probable hypothesis that there is one, with the
  // standard deviation of what it leaves in a pose's contrast, s.
  double NatsOf(const engine::Likelihood& likelihood, int* best, double* sigma_s) const;

  // How an error that every pose and finger has for itself grows with the incidence.
  enum class OwnError { kAlongNormal, kAlongSurface };  // as 1 / cos, as tan
  // Log evidence of such errors over ones of one size, nats: errors that are larger on steep faces look as if they were
  // of the surface to a test that has them all alike.
  double NatsOfOwnErrors(OwnError kind) const;

 private:
  const Workspace& workspace_;
  const touches::Prediction& details_;
  std::vector<PoseMean> means_;
  Eigen::MatrixXd values_;
};

}  // namespace touchstone::diagnosis::selection
