// What may be missing: the effects that a search tries, and what would tell those apart that fit alike.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/input.h"

namespace touchstone {

struct Candidate {
  std::shared_ptr<const Effect> effect;
  bool per_object = false;
  bool of_user = false;  // from `also`
};

// Every effect of the catalogue that changes expectations and that the model does not have yet, an object's
// pose and scale also object by object, and the user's own.
std::vector<Candidate> MakeCandidates(const DiagnosisInput& input);

// The measurement or intervention that tells two or more effects apart, for people.
std::string DecidedBy(const std::vector<std::string>& effects);

}  // namespace touchstone
