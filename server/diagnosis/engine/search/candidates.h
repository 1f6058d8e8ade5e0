// What may be missing, and what tells apart those that fit equally well.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/model/model.h"

namespace touchstone::diagnosis::engine {

struct Candidate {
  std::shared_ptr<const model::Effect> effect;
  bool per_object = false;
  bool of_user = false;     // from `also`
  std::string object = {};  // the only one on which it acts; empty: on all
  bool rare = false;        // acts on one object only, or differs between objects where rigs seldom show that
  // Values of the effect's free parameters from where it is scored and fitted, another place where it changes nothing
  // (the direction of a motion of length 0); empty: those that ParameterInfo::neutral gives.
  std::vector<double> starts_at = {};
  bool nameless = false;  // of no model file: it competes with what has a name, and is never named
};

// Before the name of an effect that the model has, where another value of it competes with a new effect.
inline constexpr char kGivenPrefix[] = "given:";

// Whether the model has an effect of this name (NameOf).
bool HasEffect(const model::Model& model, const std::string& name);

// Whether either effect declares that the other may be taken for it.
bool IsDeclaredConfounded(const model::Effect& one, const std::string& other);

// The measurements or interventions that tell the first effect from each of the others, for people. Effects declare them
// (Effect::confounded_with). Effects of photographs of which nothing is declared are told by what checks each of them. Of
// one effect: what tells it from nameless causes.
std::string DiscriminatingMeasurement(const std::vector<std::string>& effects);
// The same where the two effects declare it of each other; empty: neither does.
std::string DeclaredMeasurement(const std::string& effect, const std::string& other);

}  // namespace touchstone::diagnosis::engine
