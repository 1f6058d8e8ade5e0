// What a fit set aside because its noise does not explain it, assessed: it may be a few gross errors, or the part of the data
// that shows what is missing.
#pragma once

#include <string>
#include <vector>

namespace touchstone::diagnosis::engine {

// One way to divide measurements into groups: by object, by round, by the finger that is off.
struct Division {
  std::vector<std::string> groups;  // in words: "of lat10", "in round 3"
  std::vector<int> group;           // of each measurement; -1: of none
};

struct SetAside {
  int count = 0, of = 0;  // measurements
  std::string words;      // a sentence for people: how many, and what they share; empty if none is set aside
  bool is_finding =
      false;  // they are no few gross errors of single readings: the model is not adequate for the data
  double p =
      1;  // where they are a finding: that noise alone sets so many aside, so far off or so close together
};

// `aside[i]`: measurement i, in the order in which they were made. `rmse`: of all measurements, those set aside included;
// `noise`: what no model can go below, in the same unit. `plural`: "touches". `slips`: so many
// may be off by any amount and be single slips, where they share nothing and are at most 0.5 %.
SetAside AssessSetAside(const std::vector<char>& aside, const std::vector<Division>& divisions, double rmse,
                        double noise, const std::string& plural, int slips = 0);

}  // namespace touchstone::diagnosis::engine
