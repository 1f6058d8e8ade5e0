// The touch simulation: a batch of commanded touches through pose -> contact -> motion -> sensor.
// A pure function of the batch's given fields, the model and the surface; no state between calls but work
// space.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "server/effects/touch_batch.h"
#include "server/geometry/surface/surface.h"
#include "server/model/model.h"

namespace touchstone::touch {

// Work space of one thread; keeps its memory between batches.
struct TouchWorkspace {
  std::vector<Eigen::Vector3d> origins_m;
  std::vector<Eigen::Vector3d> directions;
  geometry::Contacts contacts;
  std::vector<double> normals;
};

class TouchSimulator {
 public:
  explicit TouchSimulator(std::shared_ptr<const model::Model> model);

  const model::Model& model() const { return *model_; }

  // What any effect of the model needs.
  bool needs_previous_press() const { return needs_previous_press_; }
  const std::vector<std::string>& needed_covariates() const { return needed_covariates_; }

  // Sets the batch's size and what the model decides (fingers, spacing). The caller then fills the given
  // fields.
  void Prepare(int size, effects::TouchBatch* batch) const;

  // Stages pose, contact and motion. Fails if a formula gives no finite number or a covariate is missing.
  absl::Status RunToMotion(effects::TouchBatch* batch, TouchWorkspace* workspace) const;

  // Stage sensor.
  absl::Status RunSensor(effects::TouchBatch* batch, TouchWorkspace* workspace) const;

  // Both. Where needs_previous_press(), previous_press_m is given: press_m of the session's previous touch, whose
  // own previous_press_m was 0. So a touch depends on the one before it and on no other.
  absl::Status Run(effects::TouchBatch* batch, TouchWorkspace* workspace) const;

 private:
  void ApplyStage(model::Stage stage, bool before_cast, effects::TouchBatch* batch) const;

  std::shared_ptr<const model::Model> model_;
  bool needs_previous_press_ = false;
  bool needs_curvature_ = false;
  std::vector<std::string> needed_covariates_;
};

// The stages without their effects, one file each.
void PoseLines(const effects::TouchBatch& batch,
               TouchWorkspace* workspace);  // pose.cpp: lines in the mesh frame
void FindContacts(bool curvature, effects::TouchBatch* batch, TouchWorkspace* workspace);  // contact.cpp
void FindFirstFingers(effects::TouchBatch* batch);                                         // motion.cpp
void TravelToTime(effects::TouchBatch* batch);                                             // motion.cpp
void ReportTimes(effects::TouchBatch* batch, TouchWorkspace* workspace);                   // sensor.cpp

// Contact times relative to the first reporting finger's (the descriptor), seconds; descriptor[finger].
// Returns false if a finger reported nothing (NaN there).
bool Descriptor(const effects::TouchBatch& batch, int touch, double* descriptor_s);

}  // namespace touchstone::touch
