#include "server/diagnosis/residuals/describe_residuals.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnosis/residuals/covariates.h"
#include "server/diagnosis/residuals/outlines.h"

namespace touchstone {
namespace {

constexpr size_t kMaxParityPoints = 2000;
constexpr int kMaxSurfacePoints = 4000;
constexpr int kMaxSurfacePointsAnObject = 1500;
constexpr int kOutlineTriangles = 400;

// Measured over simulated times, each less its mean over the touch: what only differences can tell.
void AddParity(const Observations& observations, const Prediction& initial, const std::vector<double>& before,
               const std::vector<double>& after, v1::Report* report) {
  const int fingers = observations.fingers;
  std::vector<size_t> cells;
  for (int k = 0; k < observations.size(); ++k)
    if (observations.used[k])
      for (int i = 0; i < fingers; ++i)
        if (!std::isnan(before[size_t(k) * fingers + i])) cells.push_back(size_t(k) * fingers + i);
  const size_t points = std::min(kMaxParityPoints, cells.size());
  for (size_t n = 0; n < points; ++n) {
    // Evenly over the session; the finger changes from point to point.
    const size_t cell = cells[cells.size() * n / points];
    const size_t first = cell / fingers * fingers;
    double mean_s = 0, count = 0;
    for (size_t c = first; c < first + fingers; ++c)
      if (!std::isnan(before[c])) mean_s += initial.time_s[c], count += 1;
    const double simulated_s = initial.time_s[cell] - mean_s / count;
    v1::ParityPoint* point = report->add_parity();
    point->set_simulated_us(simulated_s * 1e6);
    point->set_measured_us((simulated_s + before[cell]) * 1e6);
    point->set_improved_us(
        (simulated_s + before[cell] - (std::isnan(after[cell]) ? before[cell] : after[cell])) * 1e6);
    point->set_finger(static_cast<uint32_t>(cell % fingers));
  }
}

// One point a pose and finger: repeats touch the same spot.
void AddSurfacePoints(const Observations& observations, const Prediction& improved,
                      const std::vector<double>& before, const std::vector<double>& after,
                      v1::Report* report) {
  if (improved.contact_m.empty()) return;
  const int fingers = observations.fingers, objects = static_cast<int>(observations.objects.size());
  struct Spot {
    int touch = -1;  // the first one there
    double count = 0, before = 0, after = 0, after_count = 0;
  };
  std::vector<Spot> spots(static_cast<size_t>(observations.poses) * fingers);
  for (int k = 0; k < observations.size(); ++k) {
    if (!observations.used[k]) continue;
    for (int i = 0; i < fingers; ++i) {
      const size_t cell = size_t(k) * fingers + i;
      if (std::isnan(before[cell]) || !improved.contact_m[cell].allFinite()) continue;
      Spot& spot = spots[size_t(observations.pose[k]) * fingers + i];
      if (spot.touch < 0) spot.touch = k;
      spot.before += before[cell], spot.count += 1;
      if (!std::isnan(after[cell])) spot.after += after[cell], spot.after_count += 1;
    }
  }
  std::vector<std::vector<size_t>> of_object(objects);
  for (size_t s = 0; s < spots.size(); ++s)
    if (spots[s].touch >= 0) of_object[observations.object[spots[s].touch]].push_back(s);
  const size_t most =
      std::max(1, std::min(kMaxSurfacePointsAnObject, kMaxSurfacePoints / std::max(1, objects)));
  for (int o = 0; o < objects; ++o) {
    const size_t points = std::min(most, of_object[o].size());
    for (size_t n = 0; n < points; ++n) {
      const size_t s = of_object[o][of_object[o].size() * n / points];
      const Spot& spot = spots[s];
      const Eigen::Vector3d place_mm = improved.contact_m[size_t(spot.touch) * fingers + s % fingers] * 1e3;
      v1::SurfacePoint* point = report->add_surface_points();
      point->set_object(observations.objects[o]);
      point->set_x_mm(place_mm.x());
      point->set_y_mm(place_mm.y());
      point->set_z_mm(place_mm.z());
      point->set_residual_us(spot.before / spot.count * 1e6);
      point->set_after_us(spot.after_count ? spot.after / spot.after_count * 1e6 : 0);
      point->set_finger(static_cast<uint32_t>(s % fingers));
    }
  }
}

void AddOutlines(const Observations& observations, v1::Report* report) {
  for (size_t o = 0; o < observations.objects.size(); ++o) {
    if (!observations.surfaces[o]) continue;
    const TriangleMesh coarse = Decimated(observations.surfaces[o]->mesh(), kOutlineTriangles);
    v1::ObjectOutline* outline = report->add_outlines();
    outline->set_object(observations.objects[o]);
    for (const Eigen::Vector3f& vertex : coarse.vertices_m)
      for (int axis = 0; axis < 3; ++axis) outline->add_vertices_mm(vertex[axis] * 1e3f);
    for (const auto& triangle : coarse.triangles)
      for (const uint32_t corner : triangle) outline->add_triangles(corner);
  }
}

}  // namespace

void DescribeResiduals(const Observations& observations, const Prediction& initial,
                       const Prediction& improved, const std::vector<double>& before,
                       const std::vector<double>& after, const ResidualScale& scale, v1::Report* report) {
  DescribeGroups(observations, before, scale.sigma_s, report);
  DescribeCurves(observations, initial, before, after, scale.seed, report);
  DescribeHistograms(observations, initial, improved, scale, report);
  AddParity(observations, initial, before, after, report);
  AddSurfacePoints(observations, improved, before, after, report);
  AddOutlines(observations, report);
}

}  // namespace touchstone
