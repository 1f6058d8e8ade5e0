// Standard uncertainties of predicted contact times, after the Guide to the Expression of Uncertainty in
// Measurement (JCGM 100:2008). What is predicted is a new reading of each finger, less the mean over the
// touch's fingers: only differences between fingers are ever measured (proto/README.md). Of finger f
//
//   u^2 = sum_ij r_ij Z_i Z_j  +  u_surface^2  +  u_repeatability^2  +  u_reproducibility^2
//
// with Z_i half of how the simulator's time changes from one standard error below value i to one above (the
// Guide's 5.1.3, note 2), all noise off, and r_ij the correlation of two values.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "server/effects/contact/surface_map.h"
#include "server/touch/simulate.h"
#include "server/uncertainty/posterior.h"

namespace touchstone::uncertainty {

// Of a batch of touches of one object. Columns are [touch * fingers + finger], seconds; NaN where the finger
// meets nothing, and everywhere in a touch of which fewer than two do.
struct TimeUncertainty {
  int fingers = 0;
  std::vector<double> parameters_s, surface_s, repeatability_s;
  std::vector<double> reproducibility_s;  // 0 where nothing was estimated
  std::vector<double> combined_s;
  std::vector<std::vector<double>> effects_s;  // of each of PredictedTimes::effects() alone
  // 1: nothing was measured near (IsNear); 0 where the finger meets nothing.
  std::vector<uint8_t> beyond_measured;
  std::vector<Eigen::Vector3d> contact_m;
};

// A contact is near a measured one if it lies within this share of the diagonal of the object's box from it,
// and their normals within this angle.
inline constexpr double kNearShare = 0.1;
inline constexpr double kNearCosine = 0.86602540378443865;  // 30 deg

class PredictedTimes {
 public:
  // `posterior` must be valid (CheckPosterior).
  explicit PredictedTimes(std::shared_ptr<const Posterior> posterior);

  // Effects with open values, in the model's order: "tip_radius", "formula lead_screw".
  const std::vector<std::string>& effects() const { return effects_; }
  // Whether any value has a scatter between sessions.
  bool has_reproducibility() const { return has_reproducibility_; }

  // Memory that one thread keeps between calls.
  struct Workspace {
    effects::TouchBatch batch;
    touch::TouchWorkspace touch;
    std::vector<double> time_s, moved_s;
    std::vector<std::vector<double>> changes_s;
    std::vector<size_t> values;  // that act on the object: of Posterior::values
  };
  // Prepares the batch for the simulator (TouchSimulator::Prepare) and fills the given fields.
  using Fill = std::function<void(const touch::TouchSimulator&, effects::TouchBatch*)>;

  // Simulates the touches twice per open value. Errors are those of the simulator. Thread-safe.
  absl::Status Evaluate(const Fill& fill, Workspace* workspace, TimeUncertainty* result) const;

 private:
  struct MovedValue {
    double below = 0, above = 0;  // of the value
    double per_error = 0;         // what the change between them is worth per standard error
    touch::TouchSimulator at_below, at_above;
  };
  absl::Status Run(const touch::TouchSimulator& simulator, const Fill& fill, Workspace* workspace,
                   std::vector<double>* time_s) const;
  absl::Status FindChanges(const Fill& fill, const std::string& object, Workspace* workspace) const;
  void CombineValues(const Workspace& workspace, TimeUncertainty* result) const;
  void AddSurface(const effects::TouchBatch& batch, TimeUncertainty* result) const;
  void AddRepeatability(const effects::TouchBatch& batch, TimeUncertainty* result) const;
  void FindBeyond(const effects::TouchBatch& batch, TimeUncertainty* result) const;

  std::shared_ptr<const Posterior> posterior_;
  touch::TouchSimulator whole_;  // with its noise, whose size a batch tells
  std::vector<MovedValue> moved_;
  std::vector<std::string> effects_;
  std::vector<int> effect_of_value_;  // index into effects_
  std::vector<double> step_;          // of each value, SI: its standard error, or what stands for it
  std::map<std::string, effects::SurfaceDeparture> maps_;  // of the model's surface_map
  bool has_reproducibility_ = false;
};

}  // namespace touchstone::uncertainty
