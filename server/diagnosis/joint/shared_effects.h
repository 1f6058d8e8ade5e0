// What touches and photographs of one session say together of the effects that both see: where an object lies and how
// large it is.
//
// Each form of such an effect (on all objects, on each, on one) is fitted to the sum of both log likelihoods, with whatever
// either kind of data shows beside it searched anew: a rest of the touches that an object's pose explains as well as a
// tool's is decided by the photographs, and a camera that stands askew is no pose of its objects if the touches find these
// in their places. Where each kind wants another value than the other, beyond chance, nothing is averaged: that is a
// finding of its own, a conflict.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/inference/parameter_estimate.h"
#include "server/diagnosis/input.h"
#include "server/diagnosis/selection/result.h"

namespace touchstone::diagnosis::joint {

// A shared effect that both kinds of data together ask for.
struct SharedStep {
  std::string effect;
  bool given = false;  // of the given model: other values, no new effect
  selection::EffectScope scope = selection::EffectScope::kRig;
  std::string words;                                     // "on lat10 only"
  std::vector<inference::ParameterEstimate> parameters;  // with what either kind alone would have left
  std::vector<std::string> equivalent;
  double probability = 0;
  double gain_nats = 0;  // of the joint log evidence
  std::string shown_by;  // "touches", "photographs", "both"
  model::Model model;    // the given one with this step and those before it
};

// One effect of which each kind of data wants another value.
struct Conflict {
  std::string effect;
  std::vector<inference::ParameterEstimate> touches, photographs;
  double p = 1;           // of values so far apart by chance
  double ahead_nats = 0;  // of values of their own over one value
};

// A shared effect that explains as much as effects that either kind names by itself, and is not claimed.
struct Undecided {
  std::string effect;
  std::vector<std::string> in_place_of;  // at least one
};

struct SharedEffects {
  std::vector<SharedStep> steps;
  std::vector<Undecided> undecided;
  std::vector<Conflict> conflicts;  // if there are any, there is no step
  model::Model in_place;            // the given model with the steps
  // What values fitted to a part of the data leave on the rest: held-out error over error of the touches, and what the mean
  // square of the photographs grows by, grey levels squared.
  double heldout_ratio = 1, heldout_excess_grey2 = 0;
  std::vector<std::string> settled;  // names of all shared effects, found or not
};

// `touches`, `photographs`: the same question of the two kinds, each with a model without the other's effects (touches) or
// with all of them (photographs). Both hold enough data for a verdict of their own.
absl::StatusOr<SharedEffects> FindSharedEffects(const DiagnosisInput& touches,
                                                const DiagnosisInput& photographs,
                                                const DiagnosisContext& context);

}  // namespace touchstone::diagnosis::joint
