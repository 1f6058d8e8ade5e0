// How data say that an emulator made them: they must never be taken for a measurement, wherever they are copied to.
#pragma once

#include <string>

#include <absl/strings/string_view.h>

#include "server/session/images/image_set.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {

// Column of images.csv and of measurement files: 1 where an emulator made the row. It goes along into every file and store.
inline constexpr char kEmulatedCovariate[] = "cov_emulated";

// Of sessions that were written before JournalSession::emulated was kept, all that is known: emulators wrote it into the
// note of where the data are from.
bool NotedAsEmulated(absl::string_view provenance);

// How many rows of a set an emulator made.
int CountEmulated(const ImageSet& set);
int CountEmulated(const MeasurementSet& set);

}  // namespace touchstone::session
