// A diagnosis report (proto/touchstone/v1/diagnosis.proto) for people and for programs. All are pure
// functions of the report; a field that is empty leaves its part out.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

// What a person reads in the terminal: plain ASCII apart from the names in the report, no line
// longer than `width` columns (at least 60) unless a single word is. `colour`: ANSI escapes for emphasis,
// which take no columns.
std::string TerminalReport(const v1::Report& report, int width, bool colour);

// The same of a check: what a plan can find.
std::string TerminalCheck(const v1::Report& report, int width, bool colour);
// Several sessions one after another: the error of each, and a control chart of every value.
std::string TerminalHistory(const v1::Report& report, int width, bool colour);
// The same of an explanation: why (not) one effect.
std::string TerminalExplanation(const v1::Report& report, int width, bool colour);

// The same of how well a model predicts touches.
std::string TerminalUncertainty(const v1::Report& report, int width, bool colour);

// One HTML file that opens offline: client/workbench's page with the report's data inside; nothing is fetched. An error where
// this build has no page.
absl::StatusOr<std::string> HtmlReport(const v1::Report& report);

// The page's data, JSON: `report` (protobuf JSON with the table of touches, which JsonReport leaves out) and `words`, sentences
// that the terminal shows too.
absl::StatusOr<std::string> PageData(const v1::Report& report);

// Protobuf JSON with the names of the proto file. Every primitive and repeated field is there, and `initial`,
// `final` and `unexplained` of each entry of data too, so that a reader need not ask. As everywhere in protobuf JSON, a number that
// is not known is the string "NaN", and 64-bit integers are strings.
absl::StatusOr<std::string> JsonReport(const v1::Report& report);

}  // namespace touchstone::client
