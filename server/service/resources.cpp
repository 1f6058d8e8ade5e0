#include "server/service/resources.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <filesystem>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/effects/all_effects.h"
#include "server/source/request_checks.h"

namespace touchstone::service {

absl::StatusOr<std::unique_ptr<ModelStore>> ModelStore::Open(const std::string& folder) {
  auto store = std::make_unique<ModelStore>();
  store->folder_ = folder;
  auto nominal = std::make_shared<model::Model>(model::NominalModel());
  nominal->name = "nominal";
  store->models_["nominal"] = nominal;
  if (folder.empty()) return store;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::InvalidArgumentError(absl::StrCat("models_dir: ", folder, ": ", error.message()));
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".yaml") continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(entry.path().string(), 1 << 20));
    TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model,
                                model::ParseModel(text, entry.path().string(), effects::Catalogue(),
                                                  model::FilesBeside(entry.path().string())));
    model.name = entry.path().stem().string();
    store->models_[model.name] = std::make_shared<const model::Model>(std::move(model));
  }
  return store;
}

// Files that another replica wrote; one that does not parse is left to the replica that starts next.
void ModelStore::Refresh() const {
  if (folder_.empty()) return;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() != ".yaml" || models_.count(name)) continue;
    const auto text = ReadFile(entry.path().string(), 1 << 20);
    if (!text.ok()) continue;
    auto model = model::ParseModel(*text, entry.path().string(), effects::Catalogue(),
                                   model::FilesBeside(entry.path().string()));
    if (!model.ok()) continue;
    model->name = name;
    models_[name] = std::make_shared<const model::Model>(*std::move(model));
  }
}

absl::StatusOr<std::shared_ptr<const model::Model>> ModelStore::FindByName(const std::string& name) const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (!models_.count(name)) Refresh();
  const auto found = models_.find(name);
  if (found != models_.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [known, model] : models_) names.push_back(known);
  return absl::NotFoundError(absl::StrCat("model: no model is named '", name, "'", DidYouMean(name, names)));
}

absl::StatusOr<std::shared_ptr<const model::Model>> ModelStore::FindByHash(const std::string& prefix) const {
  if (prefix.size() < 8)
    return absl::InvalidArgumentError(
        absl::StrCat("model.hash = '", prefix, "': give at least its first 8 digits"));
  std::lock_guard<std::mutex> lock(mutex_);
  for (int tries = 0; tries < 2; ++tries) {
    for (const auto& [name, model] : models_)
      if (absl::StartsWith(model->Hash(), prefix)) return model;
    Refresh();
  }
  std::vector<std::string> known;
  for (const auto& [name, model] : models_) known.push_back(model->Hash().substr(0, 12));
  return absl::NotFoundError(
      absl::StrCat("model.hash: no model has the hash '", prefix, "'", DidYouMean(prefix, known)));
}

absl::Status ModelStore::CheckName(const std::string& name) {
  return source::CheckResourceName(name, "model.name");
}

absl::Status ModelStore::Create(const model::Model& model) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(model.name));
  std::lock_guard<std::mutex> lock(mutex_);
  Refresh();
  const auto found = models_.find(model.name);
  if (found != models_.end()) {
    if (found->second->Hash() == model.Hash()) return absl::OkStatus();
    return absl::AlreadyExistsError(
        absl::StrCat("model '", model.name, "' stands for the hash ", found->second->Hash().substr(0, 8),
                     " and a model never changes: give ", model.Hash().substr(0, 8), " another name"));
  }
  if (models_.size() >= 10000)
    return absl::ResourceExhaustedError("the store holds 10000 models; remove some from models_dir");
  if (!folder_.empty())
    TOUCHSTONE_RETURN_IF_ERROR(
        WriteFileAtomically(absl::StrCat(folder_, "/", model.name, ".yaml"), model::FormatModel(model)));
  models_[model.name] = std::make_shared<const model::Model>(model);
  return absl::OkStatus();
}

std::vector<std::shared_ptr<const model::Model>> ModelStore::All() const {
  std::lock_guard<std::mutex> lock(mutex_);
  Refresh();
  std::vector<std::shared_ptr<const model::Model>> all;
  for (const auto& [name, model] : models_) all.push_back(model);
  return all;
}

}  // namespace touchstone::service
