#include "client/cli/options/model_output.h"

#include <algorithm>
#include <filesystem>

#include "server/base/status.h"
#include "server/effects/all_effects.h"
#include "server/model/surface_map_file.h"

namespace touchstone::cli {

std::string SurfaceMapPath(const std::string& model_path) {
  if (model_path.empty() || IsStandardOutput(model_path)) return "";
  return std::filesystem::path(model_path).replace_extension(".surface.csv").string();
}

absl::Status WriteModel(const Cli& cli, const std::string& option, const std::string& path,
                        const model::Model& model, const model::Provenance& provenance) {
  const std::string from = model::FormatProvenance(provenance);
  const std::string map_path = SurfaceMapPath(path);
  if (map_path.empty()) return cli.Write(path, model::FormatModel(model) + from);
  model::Model written = model;
  for (model::EffectInstance& instance : written.effects) {
    if (instance.effect->surface_map == nullptr) continue;
    TOUCHSTONE_RETURN_IF_ERROR(cli.CheckOutputs({{option, map_path}}));
    model::SurfaceMapSpec spec = *instance.effect->surface_map;
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(map_path, model::FormatSurfaceMap(spec.objects)));
    cli.LogWritten(map_path, absl::StrCat(" (", model::SurfaceMapInWords(spec), ")"));
    spec.file = std::filesystem::path(map_path).filename().string();
    auto effect = std::make_shared<model::Effect>(*instance.effect);
    effect->surface_map = std::make_shared<const model::SurfaceMapSpec>(std::move(spec));
    instance.effect = std::move(effect);
  }
  return cli.Write(path, model::FormatModel(written, model::FileContent::kBeside) + from);
}

absl::StatusOr<model::Model> WriteModelText(const Cli& cli, const std::string& option,
                                            const std::string& path, const std::string& yaml) {
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, model::ParseModel(yaml, option, effects::Catalogue()));
  const bool with_map =
      std::any_of(model.effects.begin(), model.effects.end(),
                  [](const model::EffectInstance& one) { return one.effect->surface_map != nullptr; });
  if (!with_map) {
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(path, yaml));
    return model;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Provenance provenance, model::ReadProvenance(yaml, option));
  TOUCHSTONE_RETURN_IF_ERROR(WriteModel(cli, option, path, model, provenance));
  return model;
}

}  // namespace touchstone::cli
