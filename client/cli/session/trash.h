// touchstone session delete|restore.
#pragma once

#include <string>

#include "client/cli/common/common.h"

namespace touchstone::cli {

void AddSessionTrash(Cli* cli, CLI::App* group);

// A word after the name is a session of a journal, and of nothing else.
absl::Status CheckInJournal(const std::string& name, const std::string& in_journal);

}  // namespace touchstone::cli
