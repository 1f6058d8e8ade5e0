#include "server/service/core/resources.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <filesystem>

#include "server/base/files/new_file.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"
#include "server/source/request_checks.h"

namespace touchstone::service {
namespace {

constexpr uint64_t kMaxModelBytes = 1 << 20;

// The model in a file, by the name of the file.
absl::StatusOr<model::Model> ReadModel(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, kMaxModelBytes));
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model,
                              model::ParseModel(text, path, effects::Catalogue(), model::FilesBeside(path)));
  model.name = std::filesystem::path(path).stem().string();
  return model;
}

// A model that was acknowledged must be there after the next start: its file is read before it is one.
absl::Status CheckReadBack(const std::string& text, const model::Model& model) {
  const auto refuse = [&](absl::string_view why) {
    return absl::InvalidArgumentError(absl::StrCat(
        "model '", model.name, "' cannot be kept, since its file could not be read again: ", why));
  };
  if (text.size() > kMaxModelBytes)
    return refuse(absl::StrCat("it has ", text.size(), " bytes, and at most ", kMaxModelBytes, " are read"));
  const auto again = model::ParseModel(text, model.name, effects::Catalogue());
  if (!again.ok()) return refuse(again.status().message());
  if (again->Hash() != model.Hash()) return refuse("it would be another model");
  return absl::OkStatus();
}

}  // namespace

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
  RemoveOldDrafts(folder, kOldDraft);
  store->Refresh();
  return store;
}

// Also files that another replica wrote. One that could not be read is tried again when it has changed.
void ModelStore::Refresh() const {
  if (folder_.empty()) return;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    const std::string path = entry.path().string(), name = entry.path().stem().string();
    if (entry.path().extension() != ".yaml" || models_.count(name)) continue;
    const auto changed = std::filesystem::last_write_time(path, error);
    const auto refused = refused_.find(path);
    if (refused != refused_.end() && refused->second == changed) continue;
    absl::StatusOr<model::Model> model = ReadModel(path);
    if (!model.ok()) {
      spdlog::warn("{} is not served: {}", path, std::string(model.status().message()));
      refused_[path] = changed;
      continue;
    }
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
  if (found != models_.end()) return CheckSame(*found->second, model);
  if (models_.size() >= 10000)
    return absl::ResourceExhaustedError("the store holds 10000 models; remove some from models_dir");
  const std::string text = model::FormatModel(model);
  TOUCHSTONE_RETURN_IF_ERROR(CheckReadBack(text, model));
  if (!folder_.empty()) {
    const std::string path = absl::StrCat(folder_, "/", model.name, ".yaml");
    const absl::Status written = WriteNewFile(path, text);
    if (absl::IsAlreadyExists(written)) {
      // Another replica was given the name at the same moment, or a file is in the way that is no model.
      const absl::StatusOr<model::Model> kept = ReadModel(path);
      if (!kept.ok())
        return absl::FailedPreconditionError(absl::StrCat(
            path, " is in the way and no model: ", kept.status().message(), ". Move it away first"));
      TOUCHSTONE_RETURN_IF_ERROR(CheckSame(*kept, model));
    } else if (!written.ok()) {
      return written;
    }
  }
  models_[model.name] = std::make_shared<const model::Model>(model);
  return absl::OkStatus();
}

absl::Status ModelStore::CheckSame(const model::Model& kept, const model::Model& model) const {
  if (kept.Hash() == model.Hash()) return absl::OkStatus();
  return absl::AlreadyExistsError(absl::StrCat("model '", model.name, "' stands for the hash ",
                                               kept.Hash().substr(0, 8), " and a model never changes: give ",
                                               model.Hash().substr(0, 8), " another name"));
}

void Resources::OpenPlaces() {
  streams = std::make_unique<Places>("dataset streams run", "max_streams", options.max_streams,
                                     "max_streams_per_client", options.max_streams_per_client);
  uploads = std::make_unique<Places>("sessions are being sent", "max_uploads", options.max_uploads);
  diagnoses = std::make_unique<Places>("sets are being worked on", "max_diagnoses", options.max_diagnoses,
                                       "max_diagnoses_per_client", options.max_diagnoses_per_client);
  rate = std::make_unique<CallRate>(options.max_unary_calls_per_s, *options.clock);
  memory = std::make_unique<MemoryBudget>(options.max_memory_mib);
  stalls = std::make_unique<StallWatch>(options.stall_s, *options.clock);
}

std::vector<std::shared_ptr<const model::Model>> ModelStore::Behind(const std::string& name) const {
  std::lock_guard<std::mutex> lock(mutex_);
  Refresh();
  std::vector<std::shared_ptr<const model::Model>> behind;
  for (auto one = models_.upper_bound(name); one != models_.end(); ++one) behind.push_back(one->second);
  return behind;
}

}  // namespace touchstone::service
