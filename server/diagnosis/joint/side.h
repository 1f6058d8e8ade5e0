// One kind of measurement in a joint diagnosis: its rows, what it is explained by without the others, and the search for
// what it alone can show once the shared effects are settled.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/diagnosis/engine/modality.h"
#include "server/diagnosis/joint/joint_fit.h"

namespace touchstone::diagnosis::joint {

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
  int kind = 0;  // place in the list of modalities
  const engine::Modality* modality = nullptr;
  std::function<bool(const model::Effect&)> is_shared;  // seen by several modalities
  std::unique_ptr<engine::Experiment> settled;          // the modality's, shared values held
  std::unique_ptr<engine::StepwiseSearch> search;       // over every effect
  std::unique_ptr<engine::StepwiseSearch> own_search;   // over those that only this kind shows

  Side(const engine::Modality& modality, int kind, std::function<bool(const model::Effect&)> is_shared);

  const model::Model& given() const { return modality->given(); }
  int initial_effects() const { return static_cast<int>(given().effects.size()); }
  // What this kind alone is explained by.
  OwnEffects own_alone() const { return OwnOf(modality->alone(), initial_effects()); }
  bool HasObject(const std::string& object) const;
  // Everything free: the kind's own effects, then the shared ones.
  engine::Parameterization Free(const std::vector<SharedEffect>& shared, const OwnEffects& own) const;
  // The shared effects held at their values.
  engine::Parameterization Held(const std::vector<SharedEffect>& shared, const OwnEffects& own) const;
  // The given model's effects, and the shared ones among them.
  int InitialEffects(const std::vector<SharedEffect>& shared) const;

  // What an explanation has beyond the first `initial_effects`, and freed among the model's: without shared effects.
  OwnEffects OwnOf(const engine::Fit& fit, int initial_effects) const;
  // The shared effects of an explanation.
  std::vector<SharedEffect> SharedOf(const engine::Fit& fit) const;
};

// A shared effect with the values of a joint fit, of every kind's objects.
SharedEffect WithValues(SharedEffect shared, const JointFit& fit);

// The index of the effect in the model of a fit; -1: it is not there.
int IndexOf(const model::Model& model, const std::string& name);

// The given model with these shared effects in place.
model::Model InPlace(const model::Model& given, const std::vector<SharedEffect>& shared);

}  // namespace touchstone::diagnosis::joint
