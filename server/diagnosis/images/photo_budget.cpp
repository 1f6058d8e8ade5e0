#include "server/diagnosis/images/photo_budget.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/fitted_values.h"
#include "server/diagnosis/images/pixels/photo_cells.h"
#include "server/diagnosis/images/rows/photo_flow.h"
#include "server/diagnosis/images/rows/photo_rows.h"
#include "server/diagnosis/images/rules.h"

namespace touchstone::diagnosis::images {
namespace {

// A simulator to either side of one value; `per_unit` of the value is what the difference between them is worth.
struct MovedPhotos {
  image::PhotoSimulator below, above;
  double per_unit = 0;
  bool rays = false;  // whether the value moves them, and contours with them
};

MovedPhotos Moved(const engine::Fit& fit, int value, double step) {
  Eigen::VectorXd below = fit.point, above = fit.point;
  below[value] -= step, above[value] += step;
  below = fit.model.Clip(below), above = fit.model.Clip(above);
  const auto simulator = [&fit](const Eigen::VectorXd& point) {
    return image::PhotoSimulator(std::make_shared<const model::Model>(fit.model.At(point)));
  };
  const double between = above[value] - below[value];
  const int effect = fit.model.parameters()[value].effect;
  return {simulator(below), simulator(above), between > 0 ? 1 / between : 0,
          MovesRays(*fit.model.base().effects[effect].effect)};
}

// The mean over the pixels of a photograph of the products of derivatives; contours change by the flow of the picture.
absl::StatusOr<Eigen::MatrixXd> ProductsOf(const Photographs& photographs, int k,
                                           const image::PhotoSimulator& fitted,
                                           const std::vector<MovedPhotos>& moved) {
  const int n = static_cast<int>(moved.size());
  const size_t pixels = photographs.measured_grey[k].size();
  Eigen::MatrixXd derivatives(static_cast<Eigen::Index>(pixels), n);
  image::PhotoWorkspace workspace;
  image::PhotoOutputs details;
  details.details = true;
  TOUCHSTONE_ASSIGN_OR_RETURN(image::Photo photo, fitted.Run(photographs.requests[k], details, &workspace));
  ToRecordedMeans(*photographs.record, &photo);
  const std::vector<float> contours = ContourSquares(photo.grey, photo.width, photo.height);
  for (int i = 0; i < n; ++i) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const image::Photo below,
        moved[i].below.Run(photographs.requests[k], image::PhotoOutputs(), &workspace));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const image::Photo above,
        moved[i].above.Run(photographs.requests[k], image::PhotoOutputs(), &workspace));
    for (size_t at = 0; at < pixels; ++at)
      derivatives(static_cast<Eigen::Index>(at), i) =
          moved[i].per_unit *
          (photographs.record->Mean(above.grey[at]) - photographs.record->Mean(below.grey[at]));
    if (!moved[i].rays) continue;
    const PictureFlow flow =
        FlowOfPicture(photographs.requests[k], photo, contours, moved[i].below, moved[i].above);
    const std::vector<float> carried = CarriedBy(flow, photo, photo.grey);
    for (size_t at = 0; at < pixels; ++at)
      if (contours[at] > 0) derivatives(static_cast<Eigen::Index>(at), i) = moved[i].per_unit * carried[at];
  }
  return Eigen::MatrixXd(derivatives.transpose() * derivatives /
                         static_cast<double>(std::max<size_t>(pixels, 1)));
}

}  // namespace

absl::StatusOr<std::vector<uncertainty::Budget>> BudgetOfPhotographs(const Photographs& photographs,
                                                                     const engine::Fit& fit,
                                                                     const Eigen::MatrixXd& covariance,
                                                                     const model::Model& improved,
                                                                     double noise_grey, ThreadPool* pool) {
  const std::vector<int> values = engine::ValuesOfModel(fit.model, improved);
  const uncertainty::FittedValues fitted = engine::FittedValuesOf(fit.model, values, covariance);
  std::vector<MovedPhotos> moved;
  for (size_t i = 0; i < values.size(); ++i) {
    const double error = std::sqrt(std::max(fitted.covariance(i, i), 0.0));
    moved.push_back(Moved(fit, values[i], error));
  }
  const image::PhotoSimulator simulator(std::make_shared<const model::Model>(fit.model.At(fit.point)));
  const int count = std::min(photographs.size(), kImageRules.max_budget_photographs.value());
  std::vector<int> chosen(count);
  for (int i = 0; i < count; ++i) chosen[i] = i * photographs.size() / count;
  std::vector<absl::StatusOr<Eigen::MatrixXd>> products(count);
  ParallelFor(pool, count, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) products[i] = ProductsOf(photographs, chosen[i], simulator, moved);
  });
  uncertainty::PictureBudgetSum sum(fitted, noise_grey);
  for (int i = 0; i < count; ++i) {
    TOUCHSTONE_RETURN_IF_ERROR(products[i].status());
    sum.Add(photographs.objects[photographs.object[chosen[i]]], *products[i]);
  }
  return sum.Budgets();
}

}  // namespace touchstone::diagnosis::images
