// A commanded touch as the bytes that a journal keeps.
#pragma once

#include <optional>
#include <string>

#include "touchstone/v1/types.pb.h"

namespace touchstone {

// The same bytes for the same command in every process: ordinary serialisation writes the covariates in any
// order.
std::string CommandBytes(const v1::CommandedTouch& command);

// Nothing if the bytes are no command.
std::optional<v1::CommandedTouch> ParseCommandBytes(const std::string& bytes);

// Whether two byte strings say the same command, whatever the order of its covariates.
bool SameCommand(const std::string& a, const std::string& b);

}  // namespace touchstone
