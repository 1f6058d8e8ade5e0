#include "server/diagnosis/touches/time_uncertainties.h"

#include <cmath>

#include "server/base/status.h"

namespace touchstone::diagnosis::touches {

absl::StatusOr<SetUncertainty> UncertaintyOf(const Predictor& predictor, const Prediction& prediction,
                                             const uncertainty::PredictedTimes& times) {
  const Observations& o = predictor.observations();
  struct Batch {
    const std::vector<int>* touches = nullptr;
    uncertainty::TimeUncertainty times;
    absl::Status status;
  };
  std::vector<Batch> batches(static_cast<size_t>(predictor.pose_batches()));
  predictor.ForPoses(prediction.previous_press_m,
                     [&](int batch, const std::vector<int>& touches, const Predictor::FillBatch& fill) {
                       thread_local uncertainty::PredictedTimes::Workspace workspace;
                       batches[batch].touches = &touches;
                       batches[batch].status = times.Evaluate(fill, &workspace, &batches[batch].times);
                     });
  SetUncertainty result;
  result.combined_s.assign(o.time_s.size(), NAN);
  result.beyond_measured.assign(o.time_s.size(), 0);
  uncertainty::BudgetSum sum(times);
  for (Batch& batch : batches) {
    TOUCHSTONE_RETURN_IF_ERROR(batch.status);
    const size_t fingers = static_cast<size_t>(o.fingers);
    for (size_t t = 0; t < batch.touches->size(); ++t) {
      const int k = (*batch.touches)[t];
      for (size_t i = 0; i < fingers; ++i) {
        double& combined_s = batch.times.combined_s[t * fingers + i];
        if (!o.used[k]) combined_s = NAN;
        result.combined_s[static_cast<size_t>(k) * fingers + i] = combined_s;
        result.beyond_measured[static_cast<size_t>(k) * fingers + i] =
            static_cast<char>(!std::isnan(combined_s) && batch.times.beyond_measured[t * fingers + i]);
      }
    }
    sum.Add(o.objects[o.object[(*batch.touches)[0]]], batch.times);
  }
  result.budgets = sum.Budgets();
  return result;
}

}  // namespace touchstone::diagnosis::touches
