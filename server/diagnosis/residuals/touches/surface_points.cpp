#include "server/diagnosis/residuals/touches/surface_points.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/residuals/touches/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// One pose and finger: repeats touch the same spot.
struct Spot {
  int touch = -1;  // the first touch there
  double count = 0, before = 0, after = 0, after_count = 0;
};

std::vector<Spot> CollectSpots(const touches::Observations& observations, const touches::Prediction& improved,
                               const std::vector<double>& before, const std::vector<double>& after) {
  const int fingers = observations.fingers;
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
  return spots;
}

}  // namespace

std::vector<SurfaceResidual> MakeSurfaceResiduals(const touches::Observations& observations,
                                                  const touches::Prediction& improved,
                                                  const std::vector<double>& before,
                                                  const std::vector<double>& after) {
  std::vector<SurfaceResidual> points;
  if (improved.contact_m.empty()) return points;
  const int fingers = observations.fingers, objects = static_cast<int>(observations.objects.size());
  const std::vector<Spot> spots = CollectSpots(observations, improved, before, after);
  std::vector<std::vector<size_t>> of_object(objects);
  for (size_t s = 0; s < spots.size(); ++s)
    if (spots[s].touch >= 0) of_object[observations.object[spots[s].touch]].push_back(s);
  const size_t max_points =
      std::max(1, std::min(kTouchResidualRules.max_object_points.value(),
                           kTouchResidualRules.max_surface_points / std::max(1, objects)));
  for (int o = 0; o < objects; ++o) {
    const size_t count = std::min(max_points, of_object[o].size());
    for (size_t n = 0; n < count; ++n) {
      const size_t s = of_object[o][of_object[o].size() * n / count];
      const Spot& spot = spots[s];
      SurfaceResidual point;
      point.object = observations.objects[o];
      point.contact_m = improved.contact_m[size_t(spot.touch) * fingers + s % fingers];
      point.residual_s = spot.before / spot.count;
      point.improved_residual_s = spot.after_count ? spot.after / spot.after_count : 0;
      point.finger = static_cast<int>(s % fingers);
      points.push_back(std::move(point));
    }
  }
  return points;
}

}  // namespace touchstone::diagnosis::residuals
