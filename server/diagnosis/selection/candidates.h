// What may be missing: the effects that a search tries, and what tells apart those that fit equally well.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/input.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

struct Candidate {
  std::shared_ptr<const model::Effect> effect;
  bool per_object = false;
  bool of_user = false;     // from `also`
  std::string object = {};  // the only one on which it acts; empty: on all
  bool rare = false;        // acts on one object only, or differs between objects where rigs seldom show that
  // Values of the effect's last free parameter from where a fit starts as well: where the response is not linear.
  std::vector<double> further_starts = {};
  // Values of the effect's free parameters from where it is scored and fitted, another place where it changes nothing
  // (the direction of a motion of length 0); empty: those that ParameterInfo::neutral gives.
  std::vector<double> starts_at = {};
};

// Every effect of the catalogue that changes expectations and that the model does not have yet; behind the same on all
// objects, each with a value for every object and on one object only; and the user's own. `searched`: the touches of the search.
std::vector<Candidate> MakeCandidates(const DiagnosisInput& input, const touches::Observations& searched);

// Before the name of an effect that the model has, where another value of it competes with a new effect.
inline constexpr char kGivenPrefix[] = "given:";

// Whether either effect declares that the other may be taken for it.
bool IsDeclaredConfounded(const model::Effect& one, const std::string& other);

// The measurements or interventions that tell the first effect from each of the others, for people. Effects declare them
// (Effect::confounded_with). Effects of photographs of which nothing is declared are told by what checks each of them. Of
// one effect: what tells it from nameless causes.
std::string DiscriminatingMeasurement(const std::vector<std::string>& effects);

}  // namespace touchstone::diagnosis::selection
