// A measured set without poses, what is assumed about how it was made, and sets that a model makes in the
// same way.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <vector>

#include "server/diagnosis/distributions/assumed_plan.h"
#include "server/diagnosis/distributions/planned_touches.h"
#include "server/diagnosis/distributions/pose_free_distances.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/diagnosis/input.h"

namespace touchstone::diagnosis::distributions {

// One sample per object, in the order of the set's objects.
using PoseFreeSamples = std::vector<PoseFreeSample>;
// A reference is a simulated sample that sets are compared with: a large one, or a small one for looking at
// many models.
enum class ReferenceSize { kFull, kQuick };

class PoseFreeExperiment {
 public:
  // Checks the input; finds repeats, the noise where the set goes in rounds, and absurd sizes of the times.
  // Both arguments must outlive the experiment. Errors: no touch, an object without a mesh, other numbers of
  // fingers.
  static absl::StatusOr<std::unique_ptr<PoseFreeExperiment>> Create(const DiagnosisInput& input,
                                                                    const DiagnosisContext& context);

  // Pure functions of their arguments; callable from several threads. A set is like the measured one: as many
  // touches and rounds of each object, the same fingers missing.
  absl::StatusOr<PoseFreeSamples> MakeReference(const std::shared_ptr<const model::Model>& model,
                                                const AssumedPoses& poses, ReferenceSize size) const;
  absl::StatusOr<PoseFreeSamples> MakeSet(const std::shared_ptr<const model::Model>& model,
                                          const AssumedPoses& poses, uint64_t number) const;

  // False: cancelled.
  bool Progress(const std::string& stage, double done) const {
    return !context.progress || context.progress(stage, done);
  }
  // Whether the rounds are enough to know the noise.
  bool noise_is_known() const {
    return scatter.degrees_of_freedom >= kDistributionRules.min_degrees_of_freedom;
  }

  const DiagnosisInput& input;
  const DiagnosisContext& context;
  const session::MeasurementSet& set;
  double speed_m_s = touch::kDefaultSpeedMS;  // median of the set's, where it has speeds
  std::vector<PoseFreeObject> objects;
  double size_ratio = 1;                      // of measured to simulated times, where it is absurd; else 1
  RoundScatter scatter;                       // of one finger's time among rounds
  std::shared_ptr<const model::Model> model;  // the given one, with the noise that the rounds show
  bool noise_changed = false;                 // `model` has another noise than the given one ...
  bool noise_is_new = false;                  // ... which had none
  PoseFreeSamples measured;

 private:
  PoseFreeExperiment(const DiagnosisInput& i, const DiagnosisContext& c)
      : input(i), context(c), set(*i.set), model(i.model) {}
  absl::Status Prepare();
  absl::Status CompareSizes();
  void EstimateNoise();
  std::vector<double> MeasuredTimes(int object) const;
  absl::StatusOr<std::vector<double>> TimesOfSet(const std::shared_ptr<const model::Model>& of, int object,
                                                 const AssumedPoses& poses, uint64_t number) const;
  absl::StatusOr<std::shared_ptr<const PlannedTouches>> TouchesOfReference(int object,
                                                                           const AssumedPoses& poses,
                                                                           ReferenceSize size) const;

  // Many models simulate the same touches.
  mutable std::mutex mutex_;
  mutable std::map<std::tuple<int, double, double, ReferenceSize>, std::shared_ptr<const PlannedTouches>>
      touches_;
};

}  // namespace touchstone::diagnosis::distributions
