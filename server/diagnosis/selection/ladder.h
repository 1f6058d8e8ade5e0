// From an explanation to the report's steps, refits, unexplained rest and improved model.
#pragma once

#include "server/diagnosis/selection/explain.h"
#include "server/diagnosis/selection/quality.h"

namespace touchstone {

struct Ladder {
  Model improved;                 // steps and refits, no formula
  bool changed = false;           // improved differs from the given model
  bool values_wrong = false;      // an effect of the given model, other than noise, has other values
  bool surface = false;           // a surface error is a step
  std::vector<double> residuals;  // of the improved model, all touches
  Prediction prediction;          // of the improved model, with details
};

// Fills verdict, noise floor, refitted, steps, final, unexplained, candidates, ambiguities and the improved
// model of the report; `initial` must stand there already.
absl::StatusOr<Ladder> BuildLadder(Study* study, const Explained& explained, v1::Report* report);

// Its parts.
void AddNoise(const NoiseFindings& noise, Ladder* ladder, v1::Report* report);  // noise_steps.cpp
absl::Status DescribeCandidates(const Study& study, const Explained& explained, v1::Report* report);
absl::Status DescribeUnexplained(const Study& study, const Explained& explained, double floor_us,
                                 v1::Report* report);

// Values that a person can read: three more digits than the standard error leaves uncertain.
double RoundedTo(double value, double std_error);

}  // namespace touchstone
