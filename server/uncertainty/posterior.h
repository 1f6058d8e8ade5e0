// What a diagnosis leaves open about the model that it ends with: a joint normal distribution of its values,
// and what a prediction lacks beside them. Models may be drawn from it: domain randomisation by what was
// measured.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/model/model.h"

namespace touchstone::uncertainty {

// One number of a model that data have determined.
struct OpenValue {
  int effect = 0;                          // index into the model's effects
  int parameter = 0;                       // of that effect
  int entry = 0;                           // finger or axis; 0 of a scalar
  std::string object;                      // whose value; empty: every object's
  std::optional<double> between_sessions;  // standard deviation between sessions, SI; none: not estimated
};

// Contacts of one object, and the outward normals there; object frame.
struct MeasuredPlaces {
  std::vector<Eigen::Vector3d> contact_m, normal;
};

struct Posterior {
  model::Model model;  // its values are the means
  std::vector<OpenValue> values;
  Eigen::MatrixXd
      covariance;  // of the values, SI; may be singular (values that sum to zero, values at a bound)
  double repeatability_s = 0;   // of one reading; for a model that has no noise
  double surface_rms_m = 0;     // of the surfaces' departures from their meshes, for a model that knows none
  double surface_length_m = 0;  // ... and their correlation length
  std::map<std::string, MeasuredPlaces> measured;  // by object

  // SI. A value of one object in a model that names none for it is that of every object.
  double ValueOf(const model::Model& of, size_t value) const;
  void SetValue(size_t value, double to, model::Model* of) const;

  const model::Effect& EffectOf(size_t value) const { return *model.effects[values[value].effect].effect; }
  const model::ParameterInfo& ParameterOf(size_t value) const;
  double StdError(size_t value) const;  // SI
  // The bounds of a value, SI: of values that sum to zero they lie to either side.
  double Lower(size_t value) const;
  double Upper(size_t value) const;
};

// Checks that indices, sizes and numbers fit together. INVALID_ARGUMENT names what does not.
absl::Status CheckPosterior(const Posterior& posterior);

// Models drawn from a posterior. Draw `index` is a pure function of (posterior, seed, index), whatever was
// drawn before. A draw of which a value lies beyond its bounds is made again, all values of it: the
// distribution is the normal one cut off at the bounds. Values of which the response is smooth in 1 / value
// are normal there. Threads may share one.
class ModelDraws {
 public:
  // `posterior` must be valid (CheckPosterior).
  ModelDraws(std::shared_ptr<const Posterior> posterior, uint64_t seed);

  struct Draw {
    std::shared_ptr<const model::Model> model;
    std::vector<double> values;  // of Posterior::values, in the units of files
  };
  // FAILED_PRECONDITION: none of kMaxDraws lies within the bounds; names a value that does not.
  absl::StatusOr<Draw> Of(uint64_t index) const;

  static constexpr int kMaxDraws = 1000;
  const Posterior& posterior() const { return *posterior_; }

 private:
  std::shared_ptr<const Posterior> posterior_;
  uint64_t seed_;
  Eigen::VectorXd means_;   // 1 / value where that is normal
  Eigen::MatrixXd factor_;  // lower: factor * factor^T is the covariance
};

}  // namespace touchstone::uncertainty
