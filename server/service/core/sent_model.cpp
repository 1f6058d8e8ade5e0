#include "server/service/core/sent_model.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/effects/all_effects.h"
#include "server/model/yaml/yaml_tree.h"

namespace touchstone::service {
namespace {

constexpr size_t kKibibyte = 1024;

int Nodes(const model::YamlNode& node) {
  int nodes = 1 + static_cast<int>(node.keys.size());
  for (const model::YamlNode& item : node.items) nodes += Nodes(item);
  return nodes;
}

}  // namespace

absl::StatusOr<model::Model> ParseSentModel(const std::string& yaml, const std::string& origin,
                                            const Limits& limits) {
  if (yaml.size() > limits.max_model_kib * kKibibyte)
    return OverLimit(absl::StrCat(origin, ": size in KiB:"), (yaml.size() + kKibibyte - 1) / kKibibyte,
                     "max_model_kib", limits.max_model_kib);
  {
    TOUCHSTONE_ASSIGN_OR_RETURN(const model::YamlNode root, model::ParseYaml(yaml, origin));
    if (const int nodes = Nodes(root); nodes > limits.max_model_nodes)
      return OverLimit(absl::StrCat(origin, ": keys and values:"), nodes, "max_model_nodes",
                       limits.max_model_nodes);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model, model::ParseModel(yaml, origin, effects::Catalogue()));
  for (const model::EffectInstance& instance : model.effects)
    if (instance.object_values.size() > static_cast<size_t>(limits.max_model_objects))
      return OverLimit(absl::StrCat(origin, ": ", instance.effect->name, ": objects:"),
                       instance.object_values.size(), "max_model_objects", limits.max_model_objects);
  return model;
}

}  // namespace touchstone::service
