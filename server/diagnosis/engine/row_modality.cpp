#include "server/diagnosis/engine/row_modality.h"

#include <cmath>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"

namespace touchstone::diagnosis::engine {

RowModality::RowModality(Description description) : description_(std::move(description)) {
  likelihood_ = std::make_unique<Likelihood>(description_.rows->GroupRows(), nullptr, 0, description_.pool);
  likelihood_->SetLeastNoise(description_.noise);
  experiment_.observations = description_.rows.get();
  experiment_.likelihood = likelihood_.get();
  experiment_.pool = description_.pool;
}

absl::StatusOr<std::unique_ptr<RowModality>> RowModality::Make(Description description) {
  std::unique_ptr<RowModality> made(new RowModality(std::move(description)));
  const StepwiseSearch search(made->experiment_, made->candidates(), SearchRules(),
                              [](const std::string&) {});
  TOUCHSTONE_ASSIGN_OR_RETURN(Explanation explanation,
                              search.Run(Parameterization(made->given(), made->objects()),
                                         static_cast<int>(made->given().effects.size())));
  made->alone_ = std::move(explanation.fit);
  TOUCHSTONE_ASSIGN_OR_RETURN(const GivenAndEffects columns, ColumnsOfEffects(search, made->given()));
  const ObservationModel& rows = *made->description_.rows;
  LinearHypotheses hypotheses(rows.EliminatedValues());
  hypotheses.AddEffects(rows, columns.effects);
  made->tried_ =
      hypotheses.PValues(DataAndNoise(rows, columns.given.columns.values.col(0), made->description_.seed));
  return made;
}

absl::StatusOr<Quality> RowModality::Compare(const model::Model& model) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted, description_.rows->Predict(model));
  const double squares = description_.rows->Residual(predicted).squaredNorm();
  const int rows = description_.rows->rows();
  const double rmse = std::sqrt(squares / std::max(rows, 1));
  return Quality{rmse, rmse, ChiSquaredTail(squares / (description_.noise * description_.noise), rows)};
}

}  // namespace touchstone::diagnosis::engine
