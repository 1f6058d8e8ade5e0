#include "server/session/emulated.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>

namespace touchstone::session {

bool NamesAnEmulator(absl::string_view provenance) {
  const std::string text = absl::AsciiStrToLower(provenance);
  return absl::StrContains(text, "emulated") || absl::StrContains(text, "emulator");
}

std::string EmulatedPhotographs(const ImageSet& set) {
  const auto emulated =
      std::count_if(set.photographs.begin(), set.photographs.end(), [](const PhotographRow& row) {
        const auto found = row.covariates.find(kEmulatedCovariate);
        return found != row.covariates.end() && found->second != 0;
      });
  if (emulated == 0) return "";
  const bool all = static_cast<size_t>(emulated) == set.size();
  return absl::StrCat(all ? "The" : absl::StrCat(emulated, " of ", set.size()), " photographs are emulated (",
                      kEmulatedCovariate, "): an emulator took them, and they measure nothing.");
}

}  // namespace touchstone::session
