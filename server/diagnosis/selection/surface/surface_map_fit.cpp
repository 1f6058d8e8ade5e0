#include "server/diagnosis/selection/surface/surface_map_fit.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/matern.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/fit/support_points.h"
#include "server/diagnosis/selection/surface/rules.h"
#include "server/effects/contact/surface_map.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kMapUnitMm = 1e-5;       // departures are rounded to
constexpr double kMapPlaceUnitMm = 1e-3;  // places are rounded to, before the map is fitted
constexpr double kMapNugget = 1e-6;       // as in the map's interpolation

double RoundedMm(double value_m, double unit_mm) {
  return std::round(value_m * kMillimetresPerMetre / unit_mm) / std::round(1 / unit_mm);
}

// The posterior of one object's departures at places of support, from the rows of its sites.
model::SurfaceMapObject MapOfObject(const std::vector<engine::SmoothErrorSite>& sites,
                                    const std::vector<Eigen::Vector3d>& places, int first_row,
                                    const Eigen::VectorXd& residual, double length_m, double rms_m,
                                    double sigma_s) {
  model::SurfaceMapObject object;
  object.length_mm = RoundedMm(length_m, kMapPlaceUnitMm);
  object.rms_mm = std::max(RoundedMm(rms_m, kMapUnitMm), kMapUnitMm);
  for (const Eigen::Vector3d& place : engine::SupportPoints(places, kSurfaceRules.max_map_points)) {
    model::SurfaceMapPoint point;
    for (int axis = 0; axis < 3; ++axis) point.position_mm[axis] = RoundedMm(place[axis], kMapPlaceUnitMm);
    object.points.push_back(point);
  }
  const int m = static_cast<int>(object.points.size());
  const auto place_of = [&](int j) -> Eigen::Vector3d {
    const std::array<double, 3>& mm = object.points[j].position_mm;
    return Eigen::Vector3d(mm[0], mm[1], mm[2]) * kMetresPerMillimetre;
  };
  const double length = object.length_mm * kMetresPerMillimetre;
  Eigen::MatrixXd kernel(m, m);
  for (int a = 0; a < m; ++a)
    for (int b = 0; b <= a; ++b)
      kernel(a, b) = kernel(b, a) = Matern52((place_of(a) - place_of(b)).norm(), length);
  kernel.diagonal().array() += kMapNugget;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(kernel);

  // Rows as functions of the departures' white coordinates u: departures = L u, u ~ N(0, rms^2).
  Eigen::MatrixXd raw = Eigen::MatrixXd::Zero(residual.size(), m);
  Eigen::RowVectorXd nearness(m);
  for (const engine::SmoothErrorSite& site : sites) {
    for (int a = 0; a < m; ++a) nearness[a] = Matern52((site.position_m - place_of(a)).norm(), length);
    for (size_t j = 0; j < site.row_per_m.size(); ++j)
      raw.row(site.first_row - first_row + static_cast<int>(j)) += site.row_per_m[j] * nearness;
  }
  const Eigen::MatrixXd z = cholesky.matrixL().solve(raw.transpose()).transpose();
  Eigen::MatrixXd precision = z.transpose() * z / (sigma_s * sigma_s);
  precision.diagonal().array() += 1 / (rms_m * rms_m);
  const Eigen::LLT<Eigen::MatrixXd> posterior(precision);
  const Eigen::MatrixXd lower = cholesky.matrixL();
  const Eigen::VectorXd mean_m = lower * posterior.solve(z.transpose() * residual / (sigma_s * sigma_s));
  const Eigen::MatrixXd half = posterior.matrixL().solve(lower.transpose());
  for (int j = 0; j < m; ++j) {
    object.points[j].departure_mm = RoundedMm(mean_m[j], kMapUnitMm);
    object.points[j].std_dev_mm = RoundedMm(half.col(j).norm(), kMapUnitMm);
  }
  return object;
}

}  // namespace

absl::StatusOr<std::shared_ptr<const model::Effect>> FitSurfaceMap(const Workspace& workspace,
                                                                   const engine::Fit& fit,
                                                                   const SurfaceSupport& support) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction details,
                              workspace.searched_predictor->Run(fit.model.base(), true, false));
  const PoseEvidence evidence(workspace, fit, details);
  const engine::SmoothErrorGeometry geometry = evidence.GeometryOf(SurfaceOf(workspace, details));
  const std::vector<int> first_rows = evidence.FirstRows(true);
  const std::vector<std::string>& objects = workspace.searched->objects;
  model::SurfaceMapSpec spec;
  spec.file = "surface_map.csv";
  for (size_t group = 0; group < objects.size(); ++group) {
    const int first = first_rows[group], rows = first_rows[group + 1] - first;
    if (rows == 0 || geometry.distinct_m[group].empty()) continue;
    spec.objects[objects[group]] = MapOfObject(geometry.sites[group], geometry.distinct_m[group], first,
                                               evidence.values().col(0).segment(first, rows),
                                               support.length_m, support.rms_m, support.sigma_s);
  }
  return effects::MakeSurfaceMapEffect(spec);
}

}  // namespace touchstone::diagnosis::selection
