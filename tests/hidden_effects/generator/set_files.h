// The files of a set as a lab has them: measurements and nominal model.
#pragma once

#include <string>
#include <vector>

#include "tests/hidden_effects/generator/generate.h"

namespace touchstone::hidden {

// The plan: everything that does not depend on the hidden effects.
struct Protocol {
  std::vector<Command> commands;
  std::vector<double> session_time_s, speed_mm_s, temperature;
};

// `reported_us`: [touch * fingers + finger]; NaN: nothing reported.
std::string Csv(const Scenario& scenario, const Protocol& protocol, const std::vector<double>& reported_us);

std::string NominalYaml(const Scenario& scenario);

}  // namespace touchstone::hidden
