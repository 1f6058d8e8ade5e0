// The discrete mistakes that a measurement file may have, each with what fixes it.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::diagnosis::checks {

using engine::ProblemKind;

struct Mistake {
  ProblemKind kind = ProblemKind::kFingerOrder;
  std::string detail;  // as of DataProblem
  std::string words;   // "columns l and m of the times are exchanged", to follow "It looks as if"
  session::MeasurementFix fix;
  std::vector<std::string> objects;  // that it concerns, by their names in the file; empty: all
  bool free_size = false;            // a size was fitted, not only tried
  bool part = false;  // it concerns only some touches; fix.touches, unless they are too scattered
};

// Mistakes that concern the whole file and need no look at the objects, likelier ones first: where two fit exactly as
// well (lateral reversed, or outer fingers exchanged), the first is named first. `typical_speed_m_s` decides whether
// times or speeds are the likelier ones to have another unit.
std::vector<Mistake> MistakesOfFiles(int fingers, double typical_speed_m_s);

// A factor as a person would write it: "1000", "1/60".
std::string FactorInWords(double factor);

}  // namespace touchstone::diagnosis::checks
