// Whether the misfit that a smooth error of the surfaces takes up is one: a misfit that repeats with the pose may as
// well be an error of the pose, or depend on how a finger meets the surface and not on where.
#pragma once

#include <string>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/selection/surface/pose_evidence.h"
#include "server/diagnosis/selection/workspace.h"

namespace touchstone::diagnosis::selection {

struct SurfaceSupport {
  // Log evidence, nats, each over errors that differ from pose to pose at random.
  double field_nats = 0;         // of bumps of the surface
  double own_nats = 0;           // of errors that each pose has for itself, larger on steep faces
  double finger_field_nats = 0;  // of bumps that every finger sees its own way
  double curve_nats = 0;         // of the best curve over a covariate
  std::string curve;             // "incidence", "incidence, per object"

  double rms_m = 0, length_m = 0;  // of the bumps, beside errors per pose
  double sigma_s = 0;              // of what they leave in a pose's contrast
  bool shortest = false;           // the length is the shortest that is tried
  // Found with whole poses left out and the surface predicted there from the other poses.
  double share = 0;        // of the mean square that repeats do not explain
  double share_error = 0;  // its standard error
  double before_s = 0;     // the error without the surface, on the touches of the search
  double left_s = 0;       // what it would be

  // Of bumps of the surface among these explanations, 0 to 1.
  double Probability() const;
  bool IsSurface() const;
  // Whether something else explains the misfit clearly better.
  bool IsElsewhere() const;
  std::string SizeInWords() const;
  // What is known of the surface, for people. `rmse_s`: the error that remains.
  std::string Words(double rmse_s) const;
  // ... where a map of it is part of the model, which leaves `heldout_s` on poses that it has not seen.
  std::string WordsOfMap(double heldout_s) const;
  // ... where it is no surface.
  std::string WordsOfRest() const;
};

// Departures of the surfaces, as a function of the place. `details` must outlive it.
PoseFunction SurfaceOf(const Workspace& workspace, const touches::Prediction& details);

// Of the residuals of `fit`, on the touches of the search.
absl::StatusOr<SurfaceSupport> FindSurfaceSupport(const Workspace& workspace, const engine::Fit& fit);

}  // namespace touchstone::diagnosis::selection
