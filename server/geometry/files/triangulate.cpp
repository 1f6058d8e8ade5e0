// Polygons into triangles, by clipping ears.
//
// The face is projected along the axis in which its normal is longest (the normal of Newell's sum, which also
// holds for faces that are not quite flat). An ear is a corner whose triangle turns the way the face does and
// holds no other corner; cut it off, look again. D. Eberly, "Triangulation by Ear Clipping", 2002; there too:
// only corners that do not turn the face's way can stand inside an ear, and corners at the very place of an
// ear's own do not count, so that holes joined to the rim by a double edge work.
#include <Eigen/Geometry>
#include <cmath>

#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

using Point2 = Eigen::Vector2d;

// Twice the signed area of a triangle: positive if a, b, c turn left.
double Turn(const Point2& a, const Point2& b, const Point2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// A closed chain of corners from which ears are cut.
class EarClipper {
 public:
  EarClipper(std::vector<Point2> corners, uint64_t* work) : at_(std::move(corners)), work_(work) {
    const size_t n = at_.size();
    next_.resize(n);
    previous_.resize(n);
    for (size_t i = 0; i < n; ++i) {
      next_[i] = (i + 1) % n;
      previous_[i] = (i + n - 1) % n;
    }
    // Corners that turn left now only turn further left as ears are cut, so this list never grows.
    for (size_t i = 0; i < n; ++i)
      if (TurnAt(i) <= 0) reflex_.push_back({at_[i], i});
  }

  // Calls emit(a, b, c) for every triangle.
  template <typename Emit>
  void Run(Emit emit) {
    size_t left = at_.size();
    size_t corner = 0;
    size_t seen_without_ear = 0;
    int patience = 0;  // 0: proper ears; 1: also flat ones; 2: any corner, for faces that cross themselves
    while (left > 3) {
      if (IsEar(corner, patience)) {
        emit(previous_[corner], corner, next_[corner]);
        next_[previous_[corner]] = next_[corner];
        previous_[next_[corner]] = previous_[corner];
        // Going on two corners ahead spreads the cuts along the rim: fewer needles than a fan.
        corner = next_[next_[corner]];
        --left;
        seen_without_ear = 0;
        patience = 0;
        if (++cut_since_forgetting_ > 16 + reflex_.size() / 4) ForgetReflex();
      } else {
        corner = next_[corner];
        if (++seen_without_ear > left) {
          seen_without_ear = 0;
          ++patience;
        }
      }
    }
    emit(previous_[corner], corner, next_[corner]);
  }

 private:
  struct Reflex {
    Point2 at;
    size_t corner;
  };

  double TurnAt(size_t i) const { return Turn(at_[previous_[i]], at_[i], at_[next_[i]]); }

  bool IsEar(size_t corner, int patience) {
    ++*work_;
    if (patience >= 2 || *work_ > kMaxTriangulationWork) return true;
    const Point2 &a = at_[previous_[corner]], &b = at_[corner], &c = at_[next_[corner]];
    const double turn = Turn(a, b, c);
    if (turn < 0 || (turn == 0 && patience == 0)) return false;
    if (turn == 0) return true;
    *work_ += reflex_.size();
    const Point2 lower = a.cwiseMin(b).cwiseMin(c), upper = a.cwiseMax(b).cwiseMax(c);
    for (const Reflex& reflex : reflex_) {
      const Point2& p = reflex.at;
      // Nearly all stand outside the triangle's box.
      if (p.x() < lower.x() || p.x() > upper.x() || p.y() < lower.y() || p.y() > upper.y()) continue;
      if (Cut(reflex.corner) || p == a || p == b || p == c) continue;
      if (Turn(a, b, p) >= 0 && Turn(b, c, p) >= 0 && Turn(c, a, p) >= 0) return false;
    }
    return true;
  }

  bool Cut(size_t i) const { return next_[previous_[i]] != i; }

  // Drops corners from the list that have been cut off or turn left by now.
  void ForgetReflex() {
    size_t kept = 0;
    for (const Reflex& reflex : reflex_)
      if (!Cut(reflex.corner) && TurnAt(reflex.corner) <= 0) reflex_[kept++] = reflex;
    reflex_.resize(kept);
    cut_since_forgetting_ = 0;
  }

  std::vector<Point2> at_;
  std::vector<size_t> next_;
  std::vector<size_t> previous_;
  std::vector<Reflex> reflex_;
  size_t cut_since_forgetting_ = 0;
  uint64_t* work_;
};

// Newell's normal, from the first corner so that no digits are lost far from the origin.
Eigen::Vector3d Normal(const std::vector<Eigen::Vector3d>& points, absl::Span<const uint32_t> polygon) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const Eigen::Vector3d& origin = points[polygon[0]];
  for (size_t i = 1; i + 1 < polygon.size(); ++i)
    normal += (points[polygon[i]] - origin).cross(points[polygon[i + 1]] - origin);
  return normal;
}

std::vector<Point2> Project(const std::vector<Eigen::Vector3d>& points, absl::Span<const uint32_t> polygon,
                            const Eigen::Vector3d& normal) {
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  // The two other axes in cyclic order, swapped where the normal points down, so that the face turns left.
  int u = (axis + 1) % 3, v = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(u, v);
  std::vector<Point2> flat;
  flat.reserve(polygon.size());
  for (uint32_t corner : polygon) flat.emplace_back(points[corner][u], points[corner][v]);
  return flat;
}

}  // namespace

void Triangulate(const std::vector<Eigen::Vector3d>& points, absl::Span<const uint32_t> polygon,
                 std::vector<std::array<uint32_t, 3>>* triangles, uint64_t* work) {
  const auto emit = [&](size_t a, size_t b, size_t c) {
    triangles->push_back({polygon[a], polygon[b], polygon[c]});
  };
  const size_t n = polygon.size();
  if (n == 3) return emit(0, 1, 2);

  const Eigen::Vector3d normal = Normal(points, polygon);
  bool fan = !(normal.array() != 0.0).any();
  std::vector<Point2> flat;
  if (!fan) {
    flat = Project(points, polygon, normal);
    // A fan is right where every one of its triangles turns left; for quads and discs that is the rule.
    fan = true;
    for (size_t i = 1; i + 1 < n && fan; ++i)
      fan = Turn(flat[0], flat[i], flat[i + 1]) > 0 && Turn(flat[i - 1], flat[i], flat[i + 1]) > 0;
    *work += n;
  }
  if (fan) {
    for (size_t i = 1; i + 1 < n; ++i) emit(0, i, i + 1);
    return;
  }
  EarClipper(std::move(flat), work).Run(emit);
}

}  // namespace touchstone::geometry
