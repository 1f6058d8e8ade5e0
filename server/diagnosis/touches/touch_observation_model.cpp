#include "server/diagnosis/touches/touch_observation_model.h"

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/touches/rules.h"

namespace touchstone::diagnosis::touches {
double TouchObservationModel::TimeOfRow(int row) const {
  const int in_set = observations_.row[TouchOfRow(row)];
  const session::MeasurementSet& set = *observations_.set;
  return set.has_session_time ? set.session_time_s[in_set] : in_set;
}

absl::StatusOr<std::vector<double>> TouchObservationModel::Predict(const model::Model& model) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(Prediction prediction, predictor_.Run(model, false, false));
  return std::move(prediction.time_s);
}

Eigen::VectorXd TouchObservationModel::Residual(const std::vector<double>& predicted_s) const {
  const std::vector<double>& measured_s = observations_.time_s;
  std::vector<double> residual_s(measured_s.size());
  for (size_t e = 0; e < measured_s.size(); ++e)
    residual_s[e] = measured_s[e] - (std::isnan(predicted_s[e]) ? nominal_s_[e] : predicted_s[e]);
  return contrasts_.Apply(residual_s);
}

Eigen::VectorXd TouchObservationModel::Change(const std::vector<double>& predicted_s,
                                              const std::vector<double>& moved_s) const {
  const Observations& o = observations_;
  std::vector<double> change_s(predicted_s.size(), 0.0), sizes_s;
  for (size_t e = 0; e < predicted_s.size(); ++e) {
    const double difference_s = moved_s[e] - predicted_s[e];
    if (std::isnan(difference_s)) continue;
    change_s[e] = difference_s;
    if (difference_s != 0) sizes_s.push_back(std::abs(difference_s));
  }
  if (sizes_s.empty()) return Eigen::VectorXd::Zero(rows());
  std::nth_element(sizes_s.begin(), sizes_s.begin() + sizes_s.size() / 2, sizes_s.end());
  const double median_s = sizes_s[sizes_s.size() / 2];
  for (int k = 0; k < o.size(); ++k) {
    const double jump_s =
        std::max(kTouchRules.jump / o.set->speed_m_s[o.row[k]], kTouchRules.jump_over_median * median_s);
    for (int i = 0; i < o.fingers; ++i) {
      double& value_s = change_s[static_cast<size_t>(k) * o.fingers + i];
      if (std::abs(value_s) > jump_s) value_s = 0;
    }
  }
  return contrasts_.Apply(change_s);
}

std::vector<int> FirstRowsOfObjects(const Contrasts& contrasts, int objects) {
  std::vector<int> rows;
  for (int object = 0; object <= objects; ++object) rows.push_back(contrasts.FirstRowOfObject(object));
  return rows;
}

engine::SmoothErrorGeometry SurfaceErrorGeometry(const Observations& o, const Contrasts& contrasts,
                                                 const Prediction& details) {
  engine::SmoothErrorGeometry geometry;
  const int objects = static_cast<int>(o.objects.size());
  geometry.sites.resize(objects);
  geometry.distinct_m.resize(objects);
  int counted = 0;
  std::vector<char> seen(o.poses, 0);
  for (size_t t = 0; t < contrasts.touches().size(); ++t) {
    const int k = contrasts.touches()[t], touch = static_cast<int>(t);
    const Eigen::MatrixXd& h = contrasts.MatrixOf(touch);
    for (int i = 0; i < o.fingers; ++i) {
      if (!contrasts.TakesPart(touch, i)) continue;
      const size_t entry = static_cast<size_t>(k) * o.fingers + i;
      geometry.mean_row_per_m += details.inverse_speed_s_per_m[entry];
      ++counted;
      if (!seen[o.pose[k]]) geometry.distinct_m[o.object[k]].push_back(details.contact_m[entry]);
      engine::SmoothErrorSite site;
      site.position_m = details.contact_m[entry];
      site.first_row = contrasts.FirstRow(touch);
      const double time_per_m = -details.inverse_speed_s_per_m[entry] /
                                std::max(details.cos_incidence[entry], kTouchRules.min_cosine.value());
      for (int j = 0; j < h.rows(); ++j)
        site.row_per_m.push_back(contrasts.root_weights()[t] * time_per_m * h(j, i));
      geometry.sites[o.object[k]].push_back(std::move(site));
    }
    seen[o.pose[k]] = 1;
  }
  if (counted > 0) geometry.mean_row_per_m /= counted;
  for (const auto& surface : o.surfaces)
    geometry.size_m += (surface->bounds().max_m - surface->bounds().min_m).maxCoeff() / objects;
  return geometry;
}

}  // namespace touchstone::diagnosis::touches
