// One kind of data in a joint diagnosis: its rows, what it is explained by without the other kind, and the search for
// what it alone can show once the shared effects are settled.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/diagnosis/joint/joint_fit.h"
#include "server/diagnosis/selection/stepwise_search.h"

namespace touchstone::diagnosis::joint {

// Effects that move the surface are seen by touch and by camera: object_pose, object_scale.
inline bool IsShared(const model::Effect& effect) {
  return effect.moves_surface;
}

// A shared effect in some form: new, or of the given model with its values set free.
struct SharedEffect {
  model::EffectInstance instance;  // with values
  bool given = false;
  std::string object;  // the only one on which it acts; empty: on all
  bool rare = false;   // needs more evidence: Candidate::rare

  const std::string& name() const { return instance.effect->name; }
  // Equal for equal forms, whatever the values.
  std::string Key() const;
};

// What one kind alone shows: effects of its own that were added, and values of the given model's that were set free.
struct OwnEffects {
  std::vector<std::pair<model::EffectInstance, std::string>> added;  // with the only object; empty: all
  std::map<std::string, model::EffectInstance> freed;                // by name

  std::string Key() const;
  int size() const { return static_cast<int>(added.size() + freed.size()); }
  std::vector<std::string> Names() const;
};

struct Side {
  Kind kind = kTouches;
  std::shared_ptr<const model::Model> given;
  std::vector<std::string> objects;
  const inference::Experiment* experiment = nullptr;
  std::unique_ptr<inference::Experiment> settled;         // the same, shared values held
  std::unique_ptr<selection::StepwiseSearch> search;      // over every effect
  std::unique_ptr<selection::StepwiseSearch> own_search;  // over those that only this kind shows
  inference::Fit alone;                                   // the explanation without the other kind

  // `candidates`: every effect that may be missing.
  void Prepare(const inference::Experiment& experiment, std::vector<selection::Candidate> candidates);

  bool HasObject(const std::string& object) const;
  // Everything free: the kind's own effects, then the shared ones.
  inference::Parameterization Free(const std::vector<SharedEffect>& shared, const OwnEffects& own) const;
  // The shared effects held at their values.
  inference::Parameterization Held(const std::vector<SharedEffect>& shared, const OwnEffects& own) const;
  // The given model's effects, and the shared ones among them.
  int InitialEffects(const std::vector<SharedEffect>& shared) const;

  // What an explanation has beyond the first `initial_effects`, and freed among the model's: without shared effects.
  OwnEffects OwnOf(const inference::Fit& fit, int initial_effects) const;
  // The shared effects of an explanation.
  std::vector<SharedEffect> SharedOf(const inference::Fit& fit) const;
};

// A shared effect with the values of a joint fit, of both kinds' objects.
SharedEffect WithValues(SharedEffect shared, const JointFit& fit);

// The index of the effect in the model of a fit; -1: it is not there.
int IndexOf(const model::Model& model, const std::string& name);

// The given model with these shared effects in place.
model::Model InPlace(const model::Model& given, const std::vector<SharedEffect>& shared);

}  // namespace touchstone::diagnosis::joint
