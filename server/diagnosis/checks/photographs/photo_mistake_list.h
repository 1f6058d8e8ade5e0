// The discrete mistakes that an image set, or the model that it is compared with, may have.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/model/model.h"
#include "server/session/images/image_set_fix.h"

namespace touchstone::diagnosis::checks {

using engine::ProblemKind;

struct CandidateMistake {
  ProblemKind kind = ProblemKind::kChannelOrder;
  std::string detail;
  std::string words;  // to follow "It looks as if"
  session::ImageSetFix fix;
  std::shared_ptr<const model::Model> model;  // of a mistake in the model's values; else null
  std::string command;                        // that fixes the model
  double max_ratio = 0;                       // stricter than for others; 0: as for others
};

// What concerns a whole set, likelier mistakes first.
std::vector<CandidateMistake> MistakesOfSets(const session::ImageSet& set);

// Angles of the model's effects that may be radians where degrees belong, or the reverse.
std::vector<CandidateMistake> MistakesOfModels(const model::Model& model);

}  // namespace touchstone::diagnosis::checks
