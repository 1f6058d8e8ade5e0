// touchstone session verify.
#pragma once

#include "client/cli/common/common.h"

namespace touchstone::cli {

void AddSessionVerify(Cli* cli, CLI::App* group);

}  // namespace touchstone::cli
