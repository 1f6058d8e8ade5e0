// Whether a second sheet of the surface comes so close to a triangle that single precision may take either:
// coplanar faces that overlap, faces that cross, folds of no width. Meshes from the wild have them.
#include <cmath>

#include "server/geometry/surface/search.h"

namespace touchstone::geometry {
namespace {

struct Corners {
  Eigen::Vector3d at[3];
  Eigen::Vector3d normal;  // unit
};

Corners CornersOf(const TriangleMesh& mesh, uint32_t triangle) {
  Corners corners;
  for (int c = 0; c < 3; ++c) corners.at[c] = mesh.Corner(triangle, c);
  corners.normal = (corners.at[1] - corners.at[0]).cross(corners.at[2] - corners.at[0]).stableNormalized();
  return corners;
}

// Whether all of `other` lies beyond `distance_m` on one side of the plane of `base`, leaving out the corners
// that the two have in common.
bool ClearOfPlane(const Corners& base, const Corners& other, const bool* common, double distance_m) {
  double min_height = 1e300, max_height = -1e300;
  for (int c = 0; c < 3; ++c) {
    if (common[c]) continue;
    const double height = (other.at[c] - base.at[0]).dot(base.normal);
    min_height = std::min(min_height, height);
    max_height = std::max(max_height, height);
  }
  return min_height > distance_m || max_height < -distance_m;
}

// Whether, seen along the normal of `base`, all of `other` lies outside one of its edges, but for an overlap
// too narrow to matter: beside it, not on top.
bool Beside(const Corners& base, const Corners& other, const bool* common, double overlap_m) {
  for (int edge = 0; edge < 3; ++edge) {
    const Eigen::Vector3d& from = base.at[edge];
    const Eigen::Vector3d outwards = (base.at[(edge + 1) % 3] - from).stableNormalized().cross(base.normal);
    bool outside = true;
    for (int c = 0; c < 3; ++c) outside &= common[c] || (other.at[c] - from).dot(outwards) >= -overlap_m;
    // A common corner that is this edge's opposite one is inside it.
    for (int c = 0; c < 3; ++c) outside &= !(common[c] && other.at[c] == base.at[(edge + 2) % 3]);
    if (outside) return true;
  }
  return false;
}

}  // namespace

bool Surface::Search::ComputeNearCoincident(uint32_t triangle) const {
  const double near_m = 8 * rounding_m_;
  const Corners self = CornersOf(mesh_, triangle);
  const Eigen::Vector3f reach = Eigen::Vector3f::Constant(static_cast<float>(near_m));
  const Eigen::Vector3f a = self.at[0].cast<float>(), b = self.at[1].cast<float>(),
                        c = self.at[2].cast<float>();
  bool near_coincident = false;
  tree().VisitInBox(a.cwiseMin(b).cwiseMin(c) - reach, a.cwiseMax(b).cwiseMax(c) + reach,
                    [&](const uint32_t* ids, int count) {
                      for (int i = 0; i < count && !near_coincident; ++i) {
                        if (ids[i] == triangle) continue;
                        const Corners other = CornersOf(mesh_, ids[i]);
                        bool common_of_other[3] = {}, common_of_self[3] = {};
                        for (int p = 0; p < 3; ++p) {
                          for (int q = 0; q < 3; ++q) {
                            if (other.at[p] == self.at[q]) common_of_other[p] = common_of_self[q] = true;
                          }
                        }
                        near_coincident = !ClearOfPlane(self, other, common_of_other, near_m) &&
                                          !ClearOfPlane(other, self, common_of_self, near_m) &&
                                          !Beside(self, other, common_of_other, rounding_m_) &&
                                          !Beside(other, self, common_of_self, rounding_m_);
                      }
                    });
  return near_coincident;
}

// Two bits per triangle: 0 not yet known, 1 no, 2 yes. Asked by two threads at once, both find the same.
bool Surface::Search::NearCoincident(uint32_t triangle) const {
  std::atomic<uint8_t>& known = near_coincident_[triangle / 4];
  const int shift = 2 * (triangle % 4);
  int state = known.load(std::memory_order_relaxed) >> shift & 3;
  if (state == 0) {
    state = ComputeNearCoincident(triangle) ? 2 : 1;
    known.fetch_or(static_cast<uint8_t>(state << shift), std::memory_order_relaxed);
  }
  return state == 2;
}

}  // namespace touchstone::geometry
