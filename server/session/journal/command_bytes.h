// A commanded touch as the bytes that a journal keeps.
#pragma once

#include <optional>
#include <string>

#include "server/touch/commanded_touch.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::session {

// Two commands whose numbers (SI) differ by no more than this are the same touch.
inline constexpr double kCommandTolerance = 1e-9;

// The same bytes for the same command in every process: ordinary serialisation writes the covariates in any
// order.
std::string CommandBytes(const v1::CommandedTouch& command);

// Nothing if the bytes are no command.
std::optional<v1::CommandedTouch> ParseCommandBytes(const std::string& bytes);

// A touch as the protocol writes it; without a limit of the stroke that field stays unset.
v1::CommandedTouch CommandMessage(const touch::CommandedTouch& touch);

// As a physical source journals a touch: without its session time, since when it is made does not make it another
// touch.
std::string CommandBytes(const touch::CommandedTouch& touch);

// Whether two commands have the same path: target, approach, lateral, standoff, speed and stroke within 1e-9 (SI),
// whatever their session times and covariates.
bool SamePath(const v1::CommandedTouch& a, const v1::CommandedTouch& b);

// The one rule for "the same touch": the same path, session time and covariates, each within 1e-9, in whatever order
// the covariates were written. Bytes that are no command are the same only as bytes.
bool SameCommand(const std::string& a, const std::string& b);

}  // namespace touchstone::session
