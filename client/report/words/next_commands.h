// The commands that follow from a report: save, compare, propose.
#pragma once

#include <string>
#include <vector>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

struct NextCommand {
  std::string purpose;  // "Save the improved model"
  std::string command;
};

// Made from the command that made the report (Report.provenance), with its set, meshes and server. Empty where that is not
// known, or the report compares only.
std::vector<NextCommand> NextCommands(const v1::Report& report);

}  // namespace touchstone::client
