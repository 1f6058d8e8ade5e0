// Residuals at the contact points, for a picture on the objects' surfaces.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

// The residual of one finger at one pose, averaged over the repeats of the pose.
struct SurfaceResidual {
  std::string object;
  Eigen::Vector3d contact_m =
      Eigen::Vector3d::Zero();     // where the improved model puts the contact, object frame
  double residual_s = 0;           // of the initial model; measured minus simulated
  double improved_residual_s = 0;  // of the improved model; 0 where it misses
  int finger = 0;                  // 0 is the first
  double std_uncertainty_s = 0;    // of the improved model's time; 0: not known
  bool beyond_measured = false;    // nothing was measured near
};

// Object by object, at most 4,000 points in all and 1,500 per object, evenly spread over the poses. `before`
// and `after` are the residuals of the initial and the improved model, [k * fingers + finger], seconds, NaN
// where a finger takes no part. Empty if the prediction has no contacts.
std::vector<SurfaceResidual> MakeSurfaceResiduals(const touches::Observations& observations,
                                                  const touches::Prediction& improved,
                                                  const std::vector<double>& before,
                                                  const std::vector<double>& after);

}  // namespace touchstone::diagnosis::residuals
