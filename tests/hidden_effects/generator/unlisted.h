// Physics that the catalogue does not list: the diagnosis must report it as unexplained.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace touchstone::hidden {

// What an unlisted effect may depend on, for one finger of one touch.
struct FingerState {
  double finger = 0;  // -1, 0, 1 for l, m, r
  double travel_mm = 0, standoff_mm = 0;
  double first_finger = 0;
  double temperature = 0;
  Eigen::Vector3d approach, lateral, contact_mm;
};

struct UnlistedKind {
  const char* name;
  // Travel that is added, mm, for k = 1 mm (its unit as it comes).
  double (*travel)(const FingerState& state, double second);
  // Names of which any is a right answer to "what does the rest depend on?".
  std::vector<std::string> covariates;
};

const std::vector<UnlistedKind>& UnlistedKinds();
const UnlistedKind& FindUnlisted(const std::string& name);

}  // namespace touchstone::hidden
