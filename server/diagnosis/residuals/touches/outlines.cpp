#include "server/diagnosis/residuals/touches/outlines.h"

#include <algorithm>
#include <set>

#include "server/diagnosis/residuals/touches/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// One vertex for each occupied cell of a grid with `cells` cells along the longest side of the box.
geometry::TriangleMesh Clustered(const geometry::TriangleMesh& mesh, const geometry::Bounds& bounds,
                                 int cells) {
  const double size_m = (bounds.max_m - bounds.min_m).maxCoeff() / cells * (1 + 1e-9);
  constexpr uint32_t kNone = 0xFFFFFFFFu;
  std::vector<uint32_t> cluster_of_cell(static_cast<size_t>(cells) * cells * cells, kNone);
  std::vector<uint32_t> cluster(mesh.vertices_m.size(), kNone);
  std::vector<Eigen::Vector3d> sum;
  std::vector<double> count;
  geometry::TriangleMesh coarse;
  std::set<std::array<uint32_t, 3>> seen;
  for (const auto& triangle : mesh.triangles) {
    std::array<uint32_t, 3> corners;
    for (int c = 0; c < 3; ++c) {
      uint32_t& mine = cluster[triangle[c]];
      if (mine == kNone) {
        const Eigen::Vector3d point = mesh.vertices_m[triangle[c]].cast<double>();
        const Eigen::Vector3i at =
            ((point - bounds.min_m) / size_m).cast<int>().cwiseMax(0).cwiseMin(cells - 1);
        uint32_t& there = cluster_of_cell[(static_cast<size_t>(at.z()) * cells + at.y()) * cells + at.x()];
        if (there == kNone) {
          there = static_cast<uint32_t>(sum.size());
          sum.push_back(Eigen::Vector3d::Zero());
          count.push_back(0);
        }
        mine = there;
        sum[mine] += point;
        count[mine] += 1;
      }
      corners[c] = mine;
    }
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[0] == corners[2]) continue;
    // The same triangle, whichever corner comes first.
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    if (seen.insert(corners).second) coarse.triangles.push_back(corners);
  }
  for (size_t v = 0; v < sum.size(); ++v) coarse.vertices_m.push_back((sum[v] / count[v]).cast<float>());
  return coarse;
}

}  // namespace

geometry::TriangleMesh Decimated(const geometry::TriangleMesh& mesh, int max_triangles) {
  if (static_cast<int>(mesh.triangles.size()) <= max_triangles) return mesh;
  const geometry::Bounds bounds = geometry::ComputeBounds(mesh);
  // From the coarsest grid upwards, since coarse ones are cheap. A closed surface has about 12 cells^2
  // triangles.
  geometry::TriangleMesh best;
  for (int cells = 2; cells <= 64; ++cells) {
    geometry::TriangleMesh coarse = Clustered(mesh, bounds, cells);
    if (static_cast<int>(coarse.triangles.size()) > max_triangles) break;
    best = std::move(coarse);
  }
  return best;
}

std::vector<DrawableObject> MakeOutlines(const touches::Observations& observations) {
  std::vector<DrawableObject> outlines;
  for (size_t o = 0; o < observations.objects.size(); ++o)
    if (observations.surfaces[o])
      outlines.push_back({observations.objects[o], Decimated(observations.surfaces[o]->mesh(),
                                                             kTouchResidualRules.outline_triangles)});
  return outlines;
}

}  // namespace touchstone::diagnosis::residuals
