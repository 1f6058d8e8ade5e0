// A model file that came over the wire: how large it may be.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/model/model.h"
#include "server/service/options/limits.h"

namespace touchstone::service {

// RESOURCE_EXHAUSTED beyond max_model_kib, max_model_nodes or max_model_objects; else as model::ParseModel without files.
absl::StatusOr<model::Model> ParseSentModel(const std::string& yaml, const std::string& origin,
                                            const Limits& limits);

}  // namespace touchstone::service
