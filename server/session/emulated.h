// How data say that an emulator made them: they must never be taken for a measurement, wherever they are copied to.
#pragma once

#include <string>

#include <absl/strings/string_view.h>

#include "server/session/image_set.h"

namespace touchstone::session {

// Column of images.csv: 1 where an emulator took the photograph. It goes along into every file and store.
inline constexpr char kEmulatedCovariate[] = "cov_emulated";

// Whether what a session or a rig says of where its data are from (JournalSession::provenance) names an emulator.
bool NamesAnEmulator(absl::string_view provenance);

// The photographs of a set that an emulator took, in words for a report; empty: there is none.
std::string EmulatedPhotographs(const ImageSet& set);

}  // namespace touchstone::session
