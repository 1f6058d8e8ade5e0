// Model files as commands write them: what a model needs beside its file (a surface map) is written beside it.
#pragma once

#include <string>
#include <vector>

#include "client/cli/common/common.h"
#include "server/model/model.h"
#include "server/model/provenance.h"

namespace touchstone::cli {

// The surface map that belongs to a model file: "better.surface.csv" beside "better.yaml". Empty for standard output.
std::string SurfaceMapPath(const std::string& model_path);

// Writes a model; one with a surface map to standard output holds the map within. Says which map it wrote.
absl::Status WriteModel(const Cli& cli, const std::string& option, const std::string& path,
                        const model::Model& model, const model::Provenance& provenance = {});

// The same with a model that a report holds as text: where it has no surface map, byte for byte. Returns the model.
absl::StatusOr<model::Model> WriteModelText(const Cli& cli, const std::string& option,
                                            const std::string& path, const std::string& yaml);

}  // namespace touchstone::cli
