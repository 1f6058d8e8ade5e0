// Surface map: the real surface departs from its mesh as a diagnosis or a scan has found it.
//   d_i -= h(contact_i) / cos(inc_i),  h the departure between the map's points (model/surface_map.md)
// surface_error is the same of an unknown surface, drawn at random. An object that the map does not name keeps its mesh.
#include "server/effects/contact/surface_map.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/matern.h"
#include "server/base/units.h"
#include "server/effects/contact/surface_departure.h"
#include "server/geometry/surface/surface.h"

namespace touchstone::effects {
namespace {

// Keeps points at almost the same place from being told apart by what they were rounded to.
constexpr double kKernelNugget = 1e-6;

using DeparturesByObject = std::map<std::string, SurfaceDeparture>;

}  // namespace

SurfaceDeparture::SurfaceDeparture(const model::SurfaceMapObject& object)
    : length_m_(object.length_mm * kMetresPerMillimetre), rms_m_(object.rms_mm * kMetresPerMillimetre) {
  const int n = static_cast<int>(object.points.size());
  Eigen::VectorXd departures_m(n);
  variances_m2_.resize(n);
  for (int i = 0; i < n; ++i) {
    const model::SurfaceMapPoint& point = object.points[i];
    points_m_.push_back(Eigen::Vector3d(point.position_mm[0], point.position_mm[1], point.position_mm[2]) *
                        kMetresPerMillimetre);
    departures_m[i] = point.departure_mm * kMetresPerMillimetre;
    variances_m2_[i] = std::pow(point.std_dev_mm * kMetresPerMillimetre, 2);
  }
  Eigen::MatrixXd kernel(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j)
      kernel(i, j) = kernel(j, i) = Matern52((points_m_[i] - points_m_[j]).norm(), length_m_);
  kernel.diagonal().array() += kKernelNugget;
  kernel_.compute(kernel);
  weights_ = kernel_.solve(departures_m);
}

Eigen::VectorXd SurfaceDeparture::KernelAt(const Eigen::Vector3d& point_m) const {
  Eigen::VectorXd kernel(points_m_.size());
  for (size_t i = 0; i < points_m_.size(); ++i)
    kernel[static_cast<int>(i)] = Matern52((point_m - points_m_[i]).norm(), length_m_);
  return kernel;
}

double SurfaceDeparture::At(const Eigen::Vector3d& point_m) const {
  // In the order of the file, so that the bits do not depend on how a library adds.
  double sum = 0;
  for (size_t i = 0; i < points_m_.size(); ++i)
    sum += weights_[static_cast<int>(i)] * Matern52((point_m - points_m_[i]).norm(), length_m_);
  return sum;
}

double SurfaceDeparture::StdDevAt(const Eigen::Vector3d& point_m) const {
  const Eigen::VectorXd kernel = KernelAt(point_m);
  const Eigen::VectorXd weights = kernel_.solve(kernel);
  const double open = std::max(0.0, 1 - kernel.dot(weights)) * rms_m_ * rms_m_;
  return std::sqrt(open + std::max(0.0, weights.dot(variances_m2_)));
}

Eigen::MatrixXd SurfaceDeparture::CovarianceAt(const std::vector<Eigen::Vector3d>& points_m) const {
  const int n = static_cast<int>(points_m.size());
  std::vector<Eigen::VectorXd> kernels, weights;
  std::vector<double> support_m;
  for (const Eigen::Vector3d& point_m : points_m) {
    kernels.push_back(KernelAt(point_m));
    weights.push_back(kernel_.solve(kernels.back()));
    support_m.push_back(std::sqrt(std::max(0.0, weights.back().dot(variances_m2_))));
  }
  Eigen::MatrixXd covariance(n, n);
  for (int a = 0; a < n; ++a)
    for (int b = 0; b <= a; ++b) {
      const double alike = Matern52((points_m[a] - points_m[b]).norm(), length_m_);
      const double between = (alike - kernels[a].dot(weights[b])) * rms_m_ * rms_m_;
      covariance(a, b) = covariance(b, a) =
          (a == b ? std::max(0.0, between) : between) + support_m[a] * support_m[b] * alike;
    }
  return covariance;
}

double SurfaceDeparture::NearnessAt(const Eigen::Vector3d& point_m) const {
  return points_m_.empty() ? 0 : KernelAt(point_m).maxCoeff();
}

// The catalogue's entry, which only describes; MakeSurfaceMapEffect makes effects that act.
model::Effect SurfaceMap() {
  model::Effect effect;
  effect.name = "surface_map";
  effect.stage = model::Stage::kContact;
  effect.meaning =
      "The real surface departs from its mesh by a known smooth field, object by object, measured by a "
      "diagnosis or a scan and kept in a file.";
  effect.signature =
      "As surface_error: errors that belong to the place on the object, whatever finger, speed or direction "
      "meets it; with the map they are gone, also where no touch has been.";
  effect.check_on_rig =
      "Touch places between those of the map, or scan the object: the map holds there too, within its "
      "standard deviation.";
  effect.remedy =
      "`touchstone mesh correct` writes the mesh as it was measured; use that, or print the object anew.";
  effect.apply = [](absl::Span<const double>, TouchBatch&) {};
  return effect;
}

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeSurfaceMapEffect(const model::SurfaceMapSpec& spec) {
  if (spec.objects.empty()) return absl::InvalidArgumentError("surface_map: the map names no object");
  auto departures = std::make_shared<DeparturesByObject>();
  for (const auto& [name, object] : spec.objects) {
    if (!(object.length_mm > 0) || object.points.empty())
      return absl::InvalidArgumentError(
          absl::StrCat("surface_map: object '", name, "' needs a length above 0 and a point"));
    for (const model::SurfaceMapPoint& point : object.points)
      for (const double number : {point.position_mm[0], point.position_mm[1], point.position_mm[2],
                                  point.departure_mm, point.std_dev_mm})
        if (!std::isfinite(number))
          return absl::InvalidArgumentError(
              absl::StrCat("surface_map: a point of object '", name, "' has a number that is not finite"));
    departures->emplace(name, SurfaceDeparture(object));
  }
  auto effect = std::make_shared<model::Effect>(SurfaceMap());
  effect->surface_map = std::make_shared<const model::SurfaceMapSpec>(spec);
  effect->apply = [departures = std::shared_ptr<const DeparturesByObject>(std::move(departures))](
                      absl::Span<const double>, TouchBatch& touches) {
    const auto own = departures->find(touches.surface->name());
    if (own == departures->end()) return;
    MoveSurface([&](const Eigen::Vector3d& point_in_mesh) { return own->second.At(point_in_mesh); }, touches);
  };
  return std::shared_ptr<const model::Effect>(std::move(effect));
}

}  // namespace touchstone::effects
