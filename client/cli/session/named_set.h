// A set as the user names it on the command line.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/cli/common/common.h"
#include "server/session/measurements/measurement_set.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::cli {

inline constexpr size_t kMaxInline = 16 << 20;  // bytes of one set in a request

// A set as the user names it: its file's text, the name of a session that the server keeps, what a rig's journal
// holds, or the files of a folder of photographs (with the text of its touches.csv, if it has one).
struct NamedSet {
  std::string csv, session;
  std::optional<session::MeasurementSet> measured;
  std::optional<v1::ImageSetFiles> images;
  std::string images_sha256;
};

absl::StatusOr<NamedSet> ReadSet(const Cli& cli, const std::string& text);
// What messages call it; empty: a stored session.
std::string OriginOf(const std::string& text, const NamedSet& set);
// Puts the touches into the evidence; what is too large for one request stays in set->csv.
absl::Status SetMeasurements(const std::string& text, NamedSet* set, v1::Evidence* evidence);
// Its objects, those of the touches first. Reads all, so that errors name files here.
absl::StatusOr<std::vector<std::string>> ObjectsOf(const std::string& origin, NamedSet* set);
// Appends those that are not there.
void AppendObjects(const std::vector<std::string>& more, std::vector<std::string>* objects);

}  // namespace touchstone::cli
