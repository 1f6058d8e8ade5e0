// The example that an empty workbench offers: touches of a second simulation, as in deploy/demo, which hides an effect.
#pragma once

#include <absl/status/statusor.h>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::workbench {

// 576 touches of three built-in objects by fingers with round tips and noise, and a model that knows the noise alone. Made in
// this process, never at a server that may move a rig. The same each time.
absl::StatusOr<v1::Evidence> ExampleEvidence();

}  // namespace touchstone::workbench
