#include "server/session/images/emulated.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>

#include <algorithm>
#include <cmath>

namespace touchstone::session {

bool NotedAsEmulated(absl::string_view provenance) {
  const std::string text = absl::AsciiStrToLower(provenance);
  return absl::StrContains(text, "emulated") || absl::StrContains(text, "emulator");
}

int CountEmulated(const ImageSet& set) {
  return static_cast<int>(
      std::count_if(set.photographs.begin(), set.photographs.end(), [](const PhotographRow& row) {
        const auto found = row.covariates.find(kEmulatedCovariate);
        return found != row.covariates.end() && found->second != 0;
      }));
}

int CountEmulated(const MeasurementSet& set) {
  const auto found = set.covariates.find(kEmulatedCovariate);
  if (found == set.covariates.end()) return 0;
  // An empty field is NaN: nobody said that it is.
  return static_cast<int>(std::count_if(found->second.begin(), found->second.end(),
                                        [](double value) { return std::abs(value) > 0; }));
}

}  // namespace touchstone::session
