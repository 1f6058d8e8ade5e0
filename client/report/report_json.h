// The report as protobuf JSON, with all that the message has.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

// As JsonReport, without leaving anything out. `whitespace`: over many lines, for people.
absl::StatusOr<std::string> ReportToJson(v1::Report report, bool whitespace);

}  // namespace touchstone::client
