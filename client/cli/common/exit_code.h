// What the process says about its end.
#pragma once

#include <absl/status/status.h>

namespace touchstone::cli {

// 0 done, 2 usage or bad input, 3 source unreachable, 4 refused or failed by the source, 130 interrupted.
enum ExitCode { kDone = 0, kBadInput = 2, kUnreachable = 3, kRefused = 4, kInterrupted = 130 };
ExitCode ExitCodeOf(const absl::Status& status);

}  // namespace touchstone::cli
