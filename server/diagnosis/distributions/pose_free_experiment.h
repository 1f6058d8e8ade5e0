// A measured set without poses, what is supposed about how it was made, and sets made alike by a model.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <vector>

#include "server/diagnosis/distributions/assumed_plan.h"
#include "server/diagnosis/distributions/pose_free_distances.h"
#include "server/diagnosis/input.h"

namespace touchstone {

// One entry an object. A reference is a large sample that sets are compared with; a quick one a small sample,
// for looking at many models. Sets are like the measured one.
using UnposedSamples = std::vector<UnposedSample>;
enum class ReferenceSize { kFull, kQuick };

class UnposedCase {
 public:
  // Checks the input; estimates the repeats, the noise where the set goes in rounds, and absurd sizes.
  // Both arguments must outlive the case.
  static absl::StatusOr<std::unique_ptr<UnposedCase>> Create(const DiagnosisInput& input,
                                                             const DiagnosisContext& context);

  // Pure functions of their arguments; callable from several threads.
  absl::StatusOr<UnposedSamples> MakeReference(const std::shared_ptr<const Model>& model,
                                               const SupposedPoses& poses, ReferenceSize size) const;
  absl::StatusOr<UnposedSamples> MakeSet(const std::shared_ptr<const Model>& model,
                                         const SupposedPoses& poses, uint64_t number) const;

  bool Progress(const std::string& stage, double done) const {
    return !context.progress || context.progress(stage, done);
  }

  const DiagnosisInput& input;
  const DiagnosisContext& context;
  const MeasurementSet& set;
  double speed_m_s = kDefaultSpeedMS;
  std::vector<UnposedObject> objects;
  double size_ratio = 1;               // of measured to simulated times, where it is absurd
  double scatter_s = 0, degrees = 0;   // among rounds
  std::shared_ptr<const Model> model;  // with the noise that the rounds show
  bool noise_changed = false, noise_is_new = false;
  UnposedSamples measured;

  // Fewer degrees of freedom do not tell the noise.
  static constexpr double kFewDegrees = 20;

 private:
  UnposedCase(const DiagnosisInput& i, const DiagnosisContext& c)
      : input(i), context(c), set(*i.set), model(i.model) {}
  absl::Status Prepare();
  absl::Status CompareSizes();
  void EstimateNoise();
  std::vector<double> MeasuredTimes(int object) const;
  absl::StatusOr<std::vector<double>> TimesOfSet(const std::shared_ptr<const Model>& of, int object,
                                                 const SupposedPoses& poses, uint64_t number) const;
  absl::StatusOr<std::shared_ptr<const UnposedTouches>> TouchesOfReference(int object,
                                                                           const SupposedPoses& poses,
                                                                           ReferenceSize size) const;

  // Many models are asked about the same touches.
  mutable std::mutex mutex_;
  mutable std::map<std::tuple<int, double, double, ReferenceSize>, std::shared_ptr<const UnposedTouches>>
      touches_;
};

}  // namespace touchstone
