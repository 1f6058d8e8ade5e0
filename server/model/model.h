// A model: the nominal rig and an ordered stack of effects, its file and its content hash.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/model/effect.h"

namespace touchstone::model {

inline constexpr int kMaxFingers = 16;

// One effect of a model with its values.
struct EffectInstance {
  std::shared_ptr<const Effect> effect;
  bool per_object = false;  // scope: object
  std::vector<double>
      values;  // SI, flat, in the order of the effect's parameters; for every object not below
  std::map<std::string, std::vector<double>> object_values;  // by object name; only with per_object

  absl::Span<const double> ValuesFor(const std::string& object) const;
};

struct Model {
  std::string name;
  int fingers = 3;           // 1 to kMaxFingers
  double spacing_m = 0.030;  // between neighbouring fingers, > 0
  std::vector<EffectInstance> effects;

  // SHA-256 over everything but the name, in a canonical text: equal physics, equal hash.
  std::string Hash() const;
};

// How a model file's own files are read, by their names in it.
using ModelFileReader = std::function<absl::StatusOr<std::string>(const std::string& name)>;

// Reads files by paths relative to the folder of `model_path`. For model files of the user's own, never for those
// that came over the wire.
ModelFileReader FilesBeside(const std::string& model_path);

// Reads a model file. `files` null: a model that needs other files must hold their content. Errors name `origin` (usually the path), line and column, the key or value, and what
// would be right; an unknown key is an error.
absl::StatusOr<Model> ParseModel(const std::string& yaml, const std::string& origin,
                                 const EffectCatalogue& catalogue, const ModelFileReader& files = nullptr);

// Whether a model's other files are written into it or stand beside it under their names.
enum class FileContent { kWithin, kBeside };

// The model as a file that ParseModel reads back to the same hash.
std::string FormatModel(const Model& model, FileContent content = FileContent::kWithin);

// The model without random effects (Effect::random).
Model DeterministicPart(const Model& model);

// The nominal model: no noise, no effect.
Model NominalModel(int fingers = 3, double spacing_m = 0.030);

// `assignments` are "radius_mm=1.5", "offset_mm=0.25,0,-0.1", "scope=object", for a formula "name=...",
// "expression=...", "adds=...", "k=0.3" ("k_unit=mm", "k_min", "k_max" declare one). Returns a new model.
absl::StatusOr<Model> AddEffect(const Model& model, const std::string& effect_name,
                                const std::vector<std::string>& assignments, const EffectCatalogue& catalogue,
                                const ModelFileReader& files = nullptr);

// `name` is a built-in effect's, or a formula's or lookup's own. NOT_FOUND names what the model has. Returns a new model.
absl::StatusOr<Model> RemoveEffect(const Model& model, const std::string& name);

// What changed from `before` to `after`, a line each, in words and units; empty if the hashes are equal.
std::vector<std::string> DiffModels(const Model& before, const Model& after);

}  // namespace touchstone::model
