// What a model says about every touch of an experiment, without noise.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::touches {

// Arrays [k * fingers + finger] unless told otherwise; SI, object frame.
struct Prediction {
  int fingers = 0;
  std::vector<double> time_s;  // reported time without noise, polling or dropouts; NaN: the model misses
  std::vector<double> travel_m;
  std::vector<double> inverse_speed_s_per_m;  // of the arm at the contact
  std::vector<double> cos_incidence;
  std::vector<double> curvature_per_m;  // mean curvature of the surface; empty unless asked for
  std::vector<double> previous_press_m;
  std::vector<double> press_m;
  std::vector<Eigen::Vector3d> contact_m, normal;
  std::vector<Eigen::Vector3d> contact_in_mesh_m;  // in the frame of the mesh, which moves with the object
  std::vector<int> first_finger;                   // a touch; -1: none
};

// Deterministic part of the model (noise effects, polling, dropouts and surface_error left out) at every
// touch. `details` false fills time_s only.
absl::StatusOr<Prediction> Predict(const Observations& observations, const model::Model& model, bool details,
                                   bool curvature, ThreadPool* pool);

// Measured minus predicted less its mean over the touch's fingers that report and that the model expects to: only
// differences between fingers are measured, so nothing may depend on which finger came first. NaN elsewhere, and in
// touches with fewer than two such fingers. [k * fingers + i]
std::vector<double> Residuals(const Observations& observations, const Prediction& prediction);

struct SumOfSquares {
  double sum_of_squares = 0;
  double degrees_of_freedom = 0;
};

// sum ||residual||^2 and sum (fingers - 1) over the touches used.
SumOfSquares TotalSquares(const Observations& observations, const std::vector<double>& residuals);

// The square root of their ratio; 0 without any.
double Rmse(const Observations& observations, const std::vector<double>& residuals);

}  // namespace touchstone::diagnosis::touches
