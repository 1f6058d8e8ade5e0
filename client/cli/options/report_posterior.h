// What a report leaves open about its model, as requests carry it.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "touchstone/v1/types.pb.h"

namespace touchstone::cli {

struct ReportedPosterior {
  v1::ModelPosterior posterior;
  std::string note;  // what speaks against its numbers, for people; empty: nothing
};

// Of a file of `touchstone diagnose --json`. Errors name the file and say why it has none: it is no report, a
// comparison, one of photographs, of touches and photographs together, without a verdict.
absl::StatusOr<ReportedPosterior> PosteriorOfReport(const std::string& path);

}  // namespace touchstone::cli
