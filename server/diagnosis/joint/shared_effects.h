// What several kinds of measurement of one session say together of the effects that more than one of them sees: of touches
// and photographs, where an object lies and how large it is.
//
// Each form of such an effect (on all objects, on each, on one) is fitted to the sum of all log likelihoods, with whatever
// each kind of data shows beside it searched anew: a rest of the touches that an object's pose explains as well as a
// tool's is decided by the photographs, and a camera that stands rotated is no pose of its objects if the touches find these
// in their places. Where one kind wants another value than another, beyond chance, nothing is averaged: that is a
// finding of its own, a conflict.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/modality.h"

namespace touchstone::diagnosis::joint {

// A shared effect that all data together ask for.
struct SharedStep {
  std::string effect;
  bool given = false;  // of the given model: other values, no new effect
  engine::EffectScope scope = engine::EffectScope::kRig;
  std::string words;                                  // "on lat10 only"
  std::vector<engine::ParameterEstimate> parameters;  // with what each kind alone would have left
  std::vector<std::string> equivalent;
  double probability = 0;
  double gain_nats = 0;  // of the joint log evidence
  // The kinds in which, with everything else in place, it has a value that chance would not give it: "touches"; "both" (or
  // "all") where each of them shows it, or none by itself.
  std::string shown_by;
  model::Model model;  // the given one with this step and those before it
};

// One effect of which two kinds of data want different values.
struct Conflict {
  std::string effect;
  std::array<int, 2> kinds;
  std::array<std::vector<engine::ParameterEstimate>, 2> values;  // of those kinds
  double p = 1;                                                  // of values so far apart by chance
  double ahead_nats = 0;                                         // of values of their own over one value
};

// A shared effect that explains as much as effects that the kinds name by themselves, and is not claimed.
struct Undecided {
  std::string effect;
  std::vector<std::string> in_place_of;  // at least one
};

struct SharedEffects {
  std::vector<SharedStep> steps;
  std::vector<Undecided> undecided;
  std::vector<Conflict> conflicts;  // if there are any, there is no step
  model::Model in_place;            // the given model with the steps
  std::vector<engine::HeldOutError>
      heldout;                       // by kind, of the values that the steps give; empty: nothing was fitted
  std::vector<std::string> settled;  // names of all shared effects, found or not
};

// `kinds`: at least two, each with enough data for a verdict of its own. `given`: the model with the effects of every kind.
// `progress` is told what is tried and how much is done, 0 to 1, and answers false to cancel. Errors: CANCELLED, or what a simulator says.
absl::StatusOr<SharedEffects> FindSharedEffects(
    const std::vector<const engine::Modality*>& kinds, const model::Model& given,
    const std::function<bool(const std::string& stage, double done)>& progress);

}  // namespace touchstone::diagnosis::joint
