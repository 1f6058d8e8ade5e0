// What would be right to say about a set.
#pragma once

#include <string>
#include <vector>

#include "tests/hidden_effects/score/arms/arms.h"

namespace touchstone::hidden {

struct Answer {
  std::vector<std::string> names;       // effects, each of which is true
  std::vector<std::string> covariates;  // UNEXPLAINED with one of these first; beginnings of names
  std::vector<std::string> problems;    // CHECK_DATA with one of these kinds first
};
Answer AnswerFor(const Arm& arm, const Scenario& truth);

}  // namespace touchstone::hidden
