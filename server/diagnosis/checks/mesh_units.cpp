#include "server/diagnosis/checks/mesh_units.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/checks/object_mistakes.h"
#include "server/diagnosis/checks/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

struct KnownUnit {
  double factor;
  const char* name;
};
constexpr KnownUnit kUnits[] = {{1000, "m"}, {25.4, "inch"}, {10, "cm"},
                                {1e-3, ""},  {0.1, ""},      {1 / 25.4, ""}};

// The largest extent of an object's targets over that of its mesh; 0 without touches.
double SpreadOver(const session::MeasurementSet& set, int object, const geometry::Bounds& bounds) {
  Eigen::Vector3d min_m = Eigen::Vector3d::Constant(INFINITY), max_m = -min_m;
  for (int row = 0; row < set.size(); ++row) {
    if (set.object[row] != object) continue;
    min_m = min_m.cwiseMin(set.target_m[row]);
    max_m = max_m.cwiseMax(set.target_m[row]);
  }
  const double size_m = (bounds.max_m - bounds.min_m).maxCoeff();
  return max_m.x() >= min_m.x() && size_m > 0 ? (max_m - min_m).maxCoeff() / size_m : 0;
}

std::shared_ptr<const geometry::Surface> Scaled(const geometry::Surface& surface, const std::string& name,
                                                double factor) {
  geometry::TriangleMesh mesh = surface.mesh();
  for (Eigen::Vector3f& vertex : mesh.vertices_m) vertex *= static_cast<float>(factor);
  auto scaled = geometry::Surface::Create(name, std::move(mesh));
  return scaled.ok() ? *std::move(scaled) : nullptr;
}

}  // namespace

std::optional<MeshUnit> WrongMeshUnit(const Trial& trial, const TrialResult& before) {
  const DiagnosisInput& input = trial.input();
  const std::vector<std::string>& objects = input.set->objects;
  for (const KnownUnit& unit : kUnits) {
    MeshUnit found{{}, unit.name, unit.factor, input};
    for (size_t o = 0; o < objects.size(); ++o) {
      const geometry::Surface& surface = *input.surfaces.at(objects[o]);
      const double spread = SpreadOver(*input.set, static_cast<int>(o), surface.bounds());
      const bool fits = spread >= kCheckRules.min_spread && spread <= kCheckRules.max_spread;
      const double then = spread / unit.factor;
      if (fits || then < kCheckRules.min_spread || then > kCheckRules.max_spread) continue;
      auto scaled = Scaled(surface, objects[o], unit.factor);
      if (scaled == nullptr) continue;
      found.fixed.surfaces[objects[o]] = std::move(scaled);
      found.objects.push_back(objects[o]);
    }
    if (found.objects.empty()) continue;
    const Trial again(found.fixed, trial.rows());
    const absl::StatusOr<TrialResult> after = again.Run({});
    if (!after.ok()) continue;
    if (after->Relative(found.objects) <= kCheckRules.max_left &&
        after->Relative(found.objects) <=
            kCheckRules.max_ratio * std::min(before.Relative(found.objects), kCheckRules.max_before.value()))
      return found;
  }
  return std::nullopt;
}

}  // namespace touchstone::diagnosis::checks
