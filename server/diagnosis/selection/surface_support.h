// Whether the misfit that a smooth error of the surfaces takes up is one: a misfit that repeats with the pose may as
// well be an error of the pose, or depend on how a finger meets the surface and not on where.
#pragma once

#include <string>

#include "server/diagnosis/inference/fit.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis::selection {

struct SurfaceSupport {
  // Log evidence, nats, each over errors that differ from pose to pose at random.
  double field_nats = 0;         // of bumps of the surface
  double finger_field_nats = 0;  // of bumps that every finger sees its own way
  double curve_nats = 0;         // of the best curve over a covariate
  std::string curve;             // "incidence", "incidence, per object"

  double rms_m = 0, length_m = 0;  // of the bumps, beside errors per pose
  bool shortest = false;           // the length is the shortest that is tried
  // Found with whole poses left out and the surface predicted there from the other poses.
  double share = 0;        // of the mean square that repeats do not explain
  double share_error = 0;  // its standard error
  double left_s = 0;       // what the error would be

  bool IsSurface() const;
  // What is known of the surface, for people. `rmse_s`: the error that remains.
  std::string Words(double rmse_s) const;
  // ... where it is no surface.
  std::string WordsOfRest() const;
};

// Of the residuals of `fit`, on the touches of the search.
absl::StatusOr<SurfaceSupport> FindSurfaceSupport(const Workspace& workspace, const inference::Fit& fit);

}  // namespace touchstone::diagnosis::selection
