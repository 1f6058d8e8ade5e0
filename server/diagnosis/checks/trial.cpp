#include "server/diagnosis/checks/trial.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/checks/rules.h"
#include "server/diagnosis/checks/sampled_set.h"
#include "server/diagnosis/touches/predictor.h"

namespace touchstone::diagnosis::checks {
namespace {

// A finger that reported and that the model lets miss: nothing is explained.
bool ErrorOf(const touches::Observations& o, const touches::Prediction& predicted, int k, TouchError* error) {
  double measured_sum = 0, predicted_sum = 0;
  int reported = 0;
  bool misses = false;
  const size_t begin = static_cast<size_t>(k) * o.fingers, end = begin + o.fingers;
  for (size_t e = begin; e < end; ++e) {
    if (std::isnan(o.time_s[e])) continue;
    ++reported;
    measured_sum += o.time_s[e];
    predicted_sum += predicted.time_s[e];
    misses |= std::isnan(predicted.time_s[e]);
  }
  if (reported < 2) return false;
  for (size_t e = begin; e < end; ++e) {
    if (std::isnan(o.time_s[e])) continue;
    const double m = o.time_s[e] - measured_sum / reported;
    const double p = misses ? 0 : predicted.time_s[e] - predicted_sum / reported;
    error->spread_s2 += m * m / (reported - 1);
    error->error_s2 += (m - p) * (m - p) / (reported - 1);
    error->product_s2 += m * p / (reported - 1);
    error->predicted_s2 += p * p / (reported - 1);
  }
  // No better than no prediction at all, however close the fingers came to each other.
  if (misses) error->error_s2 = 4 * error->spread_s2;
  return true;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

template <typename Field>
double MeanOfBest(std::vector<TouchError>* errors, Field field) {
  const size_t counted = std::max<size_t>(1, std::llround(kCheckRules.counted_share * errors->size()));
  std::sort(errors->begin(), errors->end(),
            [&](const TouchError& a, const TouchError& b) { return a.*field < b.*field; });
  double sum = 0;
  for (size_t t = 0; t < counted; ++t) sum += (*errors)[t].*field;
  return sum / static_cast<double>(counted);
}

}  // namespace

double TrialResult::Relative(const std::vector<std::string>& names) const {
  double error = 0, spread = 0;
  for (const auto& [name, object] : objects) {
    if (!names.empty() && std::find(names.begin(), names.end(), name) == names.end()) continue;
    error += object.error_s2;
    spread += object.spread_s2;
  }
  return spread > 0 ? std::sqrt(error / spread) : 0;
}

double TrialResult::ErrorM(const std::vector<std::string>& names) const {
  double error = 0;
  int count = 0;
  for (const auto& [name, object] : objects) {
    if (!names.empty() && std::find(names.begin(), names.end(), name) == names.end()) continue;
    error += object.error_s2;
    ++count;
  }
  return count > 0 ? std::sqrt(error / count) * speed_m_s : 0;
}

ObjectError RobustError(std::vector<TouchError> touches) {
  if (touches.empty()) return {};
  ObjectError total;
  total.touches = static_cast<int>(touches.size());
  total.spread_s2 = MeanOfBest(&touches, &TouchError::spread_s2);
  total.error_s2 = MeanOfBest(&touches, &TouchError::error_s2);
  return total;
}

Trial::Trial(const DiagnosisInput& input, std::vector<int> rows) : input_(input), rows_(std::move(rows)) {}

absl::StatusOr<TrialResult> Trial::Run(const session::MeasurementFix& fix) const {
  // A part of the rows has other neighbours than the file: they are shifted here.
  session::MeasurementFix rest = fix;
  rest.shift_rows = 0;
  DiagnosisInput input = input_;
  const auto set = PartOf(*input_.set, rows_, fix.shift_rows);
  TOUCHSTONE_RETURN_IF_ERROR(session::ApplyFix(rest, set.get()).status());
  input.set = set;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations o, touches::MakeObservations(input));
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction predicted,
                              touches::Predict(o, *input.model, false, false, nullptr));
  TrialResult result;
  result.speed_m_s = Median(set->speed_m_s);
  // By the objects of the file, whatever the fix calls them.
  std::vector<std::vector<TouchError>> of_object(input_.set->objects.size());
  result.touches.resize(rows_.size());
  for (int k = 0; k < o.size(); ++k) {
    TouchError error;
    if (!ErrorOf(o, predicted, k, &error)) continue;
    error.object = input_.set->object[rows_[o.row[k]]];
    of_object[error.object].push_back(error);
    result.touches[o.row[k]] = error;
  }
  double product = 0, square = 0, error_s2 = 0, contrasts = 0;
  for (size_t object = 0; object < of_object.size(); ++object) {
    std::vector<TouchError>& errors = of_object[object];
    if (errors.empty()) continue;
    ObjectError& total = result.objects[input_.set->objects[object]];
    total.touches = static_cast<int>(errors.size());
    total.spread_s2 = MeanOfBest(&errors, &TouchError::spread_s2);
    total.error_s2 = MeanOfBest(&errors, &TouchError::error_s2);
    const size_t counted = std::max<size_t>(1, std::llround(kCheckRules.counted_share * errors.size()));
    for (size_t t = 0; t < counted; ++t) {
      product += errors[t].product_s2;
      square += errors[t].predicted_s2;
      error_s2 += errors[t].error_s2;
      contrasts += o.fingers - 1;
    }
  }
  result.scale = square > 0 ? product / square : 0;
  result.scale_error =
      square > 0 && contrasts > 0 ? std::sqrt(error_s2 / contrasts * (o.fingers - 1) / square) : 0;
  return result;
}

}  // namespace touchstone::diagnosis::checks
