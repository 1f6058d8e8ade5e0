// What the model leaves of the sampled touches, as they are and as a mistake's fix would make them.
//
// The residual is the contrast between the fingers (touches/contrasts.h), so what all fingers share cannot be seen.
// Errors are robust: of each object's touches the best 70 % count. Physics that is missing makes a few touches jump
// from edge to edge, some touches fail, and neither may hide a mistake or make one.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/checks/mistakes.h"
#include "server/diagnosis/input.h"

namespace touchstone::diagnosis::checks {

// Of one object, s^2 per contrast.
struct ObjectError {
  int touches = 0;       // that the model could be compared with
  double error_s2 = 0;   // mean square of the residual, best 70 % of the touches
  double spread_s2 = 0;  // of the measured differences themselves, the same way
};

// Of one touch, per contrast.
struct TouchError {
  int object = 0;  // of the file
  double error_s2 = 0, spread_s2 = 0;
  double product_s2 = 0, predicted_s2 = 0;  // <predicted, measured>, <predicted, predicted>
};

struct TrialResult {
  std::vector<std::optional<TouchError>> touches;  // of Trial::rows(); none: nothing to compare
  std::map<std::string, ObjectError> objects;      // by the names of the file as it is
  // <predicted, measured> / <predicted, predicted> over the touches that count: 1 if the scale is right.
  double scale = 1, scale_error = 0;
  double speed_m_s = 0;  // median

  // sqrt(sum error / sum spread) over `names` (empty: all): 0 if all is explained, 1 if nothing is.
  double Relative(const std::vector<std::string>& names) const;
  // The same error as a length that a finger travels.
  double ErrorM(const std::vector<std::string>& names) const;
};

// Over the touches that count of those given: the mean error and spread, s^2.
ObjectError RobustError(std::vector<TouchError> touches);

class Trial {
 public:
  // `rows`: of the input's set. `input` must outlive it.
  Trial(const DiagnosisInput& input, std::vector<int> rows);

  // Fails where the fixed set contradicts the model; that mistake is out then.
  absl::StatusOr<TrialResult> Run(const session::MeasurementFix& fix) const;

  const DiagnosisInput& input() const { return input_; }
  const std::vector<int>& rows() const { return rows_; }

 private:
  const DiagnosisInput& input_;
  std::vector<int> rows_;
};

}  // namespace touchstone::diagnosis::checks
