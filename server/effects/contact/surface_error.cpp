// Surface error: the real surface departs from its mesh by smooth bumps along the normal, as bad prints do.
//   d_i -= h(contact_i) / cos(inc_i),  h a smooth random field with the given RMS and correlation length
// First order, see surface_departure.h. Every object has a field of its own, drawn from (seed, name of the object),
// fixed to the object: it moves and turns with it. h has the given RMS over the whole surface of the object, exactly
// up to the sampling of the surface (1 %).
#include <cmath>
#include <map>
#include <mutex>
#include <tuple>

#include "server/base/numbers/random.h"
#include "server/effects/contact/smooth_field.h"
#include "server/effects/contact/surface_departure.h"
#include "server/effects/define_effect.h"
#include "server/geometry/surface/surface.h"

namespace touchstone::effects {
namespace {

constexpr int kSurfacePoints = 4096;
constexpr size_t kMaxRemembered = 64;

struct Parameters {
  double rms_m;
  double length_m;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::rms_m, "rms_mm", Unit::kMillimetre, 0, 5, 0, 0.2,
     "RMS of the bumps over the object's surface."},
    {&Parameters::length_m, "length_mm", Unit::kMillimetre, 1, 500, 20, 20,
     "Correlation length: how far apart two places must be for their bumps to "
     "differ. Changes nothing at rms_mm 0."},
};

// FNV-1a: the object's number in the stream of surface fields.
uint64_t ObjectId(const std::string& name) {
  uint64_t hash = 0xcbf29ce484222325u;
  for (const unsigned char c : name) hash = (hash ^ c) * 0x100000001b3u;
  return hash;
}

// Points spread evenly over the area of a mesh: one from each of kSurfacePoints equal shares of it.
std::vector<Eigen::Vector3d> PointsOnSurface(const geometry::TriangleMesh& mesh) {
  std::vector<double> area_until(mesh.triangles.size());
  double area = 0;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d a = mesh.Corner(t, 0);
    area += 0.5 * (mesh.Corner(t, 1) - a).cross(mesh.Corner(t, 2) - a).norm();
    area_until[t] = area;
  }
  RandomStream random(0, RandomDomain::kSurfaceField, 0, /*attempt=*/1);
  std::vector<Eigen::Vector3d> points;
  points.reserve(kSurfacePoints);
  uint32_t triangle = 0;
  for (int k = 0; k < kSurfacePoints; ++k) {
    const double place = area * (k + random.Uniform()) / kSurfacePoints;
    while (triangle + 1 < area_until.size() && area_until[triangle] <= place) ++triangle;
    double u = random.Uniform();
    double v = random.Uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Eigen::Vector3d a = mesh.Corner(triangle, 0);
    points.push_back(a + u * (mesh.Corner(triangle, 1) - a) + v * (mesh.Corner(triangle, 2) - a));
  }
  return points;
}

// Fields and surface points that were used lately, so that a field is made once and not once per batch. A
// cache of pure functions: eviction changes the speed alone.
class FieldCache {
 public:
  std::shared_ptr<const SmoothField> Get(const geometry::Surface& surface, uint64_t seed, double length_m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Key key(surface.hash(), surface.name(), seed, length_m);
    auto field = fields_.find(key);
    if (field != fields_.end()) return field->second;
    if (fields_.size() >= kMaxRemembered) fields_.clear();
    if (points_.size() >= kMaxRemembered) points_.clear();
    auto points = points_.find(surface.hash());
    if (points == points_.end())
      points = points_.emplace(surface.hash(), PointsOnSurface(surface.mesh())).first;
    auto made = std::make_shared<const SmoothField>(seed, ObjectId(surface.name()), length_m, points->second);
    fields_.emplace(key, made);
    return made;
  }

 private:
  using Key = std::tuple<std::string, std::string, uint64_t, double>;
  std::mutex mutex_;
  std::map<std::string, std::vector<Eigen::Vector3d>> points_;
  std::map<Key, std::shared_ptr<const SmoothField>> fields_;
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.rms_m == 0) return;
  static FieldCache& cache = *new FieldCache;  // never destroyed: worker threads may outlive main
  const std::shared_ptr<const SmoothField> field = cache.Get(*touches.surface, touches.seed, p.length_m);
  MoveSurface([&](const Eigen::Vector3d& point_in_mesh) { return p.rms_m * field->At(point_in_mesh); },
              touches);
}

}  // namespace

model::Effect SurfaceError() {
  return DefineEffect<Parameters>({
      .name = "surface_error",
      .stage = model::Stage::kContact,
      .role = model::EffectRole::kSmoothError,
      .always_per_object = true,
      .meaning = "The real surface departs from its mesh by smooth bumps along the normal: "
                 "a bad print, a dent, paint.",
      .signature =
          "Errors that hang on the place on the object and on nothing else: neighbouring contacts err alike, "
          "whatever finger, speed or direction, and another object shows another pattern.",
      .check_on_rig =
          "Touch the same place with two different fingers and from two directions: the error stays with the "
          "place. Or scan the object.",
      .remedy = "Print anew, sand, or scan the object and use the scan as its mesh.",
      .confounded_with =
          {
              {"", "Turn the object by 180 deg and touch the same places: bumps turn with it."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
