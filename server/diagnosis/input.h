// What a diagnosis is asked: a model, a measurement set or photographs, and the surfaces of the objects.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "server/base/threads/thread_pool.h"
#include "server/geometry/missing_mesh.h"
#include "server/geometry/surface/surface.h"
#include "server/model/model.h"
#include "server/session/images/image_set.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::diagnosis {

struct DiagnosisInput {
  std::shared_ptr<const model::Model> model;
  std::shared_ptr<const session::MeasurementSet> set;                        // null: photographs alone
  std::shared_ptr<const session::ImageSet> images = {};                      // null: touches alone
  std::map<std::string, std::shared_ptr<const geometry::Surface>> surfaces;  // by the set's object names
  std::vector<std::shared_ptr<const model::Effect>>
      also;  // formulas of the user that compete with the catalogue
  uint64_t seed = 0;
  // Where the surfaces are what is left: put a map of them into the improved model instead of their size.
  bool with_surface_map = false;
  // Part of a joint diagnosis of touches and photographs. Names of effects that are settled by both: they are no candidates,
  // and where the model has them their values stay.
  std::vector<std::string> settled;
  // A second model that a comparison of touches is made with; null: none.
  std::shared_ptr<const model::Model> other_model;
  // SHA-256 of the contents of the sets that the model was fitted to, as far as its file says.
  std::vector<std::string> fitted_to;
  // Whose errors are told as the initial ones; null: the model's.
  std::shared_ptr<const model::Model> initial_model;
  bool IsSettled(const std::string& effect) const {
    return std::find(settled.begin(), settled.end(), effect) != settled.end();
  }
};

// That every object of a set has a surface; NOT_FOUND names those that have none.
inline absl::Status CheckMeshes(const DiagnosisInput& input, const std::string& origin,
                                const std::vector<std::string>& objects) {
  std::vector<std::string> missing, known;
  for (const std::string& object : objects)
    if (input.surfaces.count(object) == 0) missing.push_back(object);
  if (missing.empty()) return absl::OkStatus();
  for (const auto& [name, surface] : input.surfaces) known.push_back(name);
  return geometry::MissingMesh(origin + ": object ", missing, known);
}

struct DiagnosisContext {
  ThreadPool* pool = nullptr;  // null: this thread alone
  // Called often, from one thread at a time. Returns false to cancel: the call then ends with CANCELLED soon.
  std::function<bool(const std::string& stage, double done)> progress;

  // Tells of a stage. Error: CANCELLED.
  absl::Status Enter(const std::string& stage, double done) const {
    if (!progress || progress(stage, done)) return absl::OkStatus();
    return absl::CancelledError("the diagnosis was cancelled");
  }
};

}  // namespace touchstone::diagnosis
