// touchstone session fix: fixes a discrete mistake of a measurement file.
#pragma once

#include "client/cli/common/common.h"

namespace touchstone::cli {

// Adds the command to the group `session`.
void AddSessionFix(Cli* cli, CLI::App* group);

}  // namespace touchstone::cli
