// First contacts of spheres. The line of the foremost point, cast first, bounds the travel: where it meets
// the surface the sphere has touched. Then every triangle whose box, inflated by the radius, lies along the
// way is a candidate; eight at a time get a lower bound of their contact in single precision, and the few
// whose bound is below the best contact so far are computed in double precision.
#include <cmath>
#include <limits>

#include "server/base/check.h"
#include "server/base/numbers/nan.h"
#include "server/geometry/lanes.h"
#include "server/geometry/surface/search.h"
#include "server/geometry/surface/swept_triangle.h"

namespace touchstone::geometry {
namespace {

using Lanes = Float8;
using Lanes3 = Triple<Float8>;

constexpr float kNever = std::numeric_limits<float>::max();

Contact NoSphereContact() {
  return {kNaN, Eigen::Vector3d::Constant(kNaN), Eigen::Vector3d::Zero(), kNoTriangle};
}

// Whether a sphere of radius r may touch triangles abc by travel `latest`: by the box round each, in axes
// along and across the line. Much cheaper than EarliestTouch.
Mask8 RoughlyReached(const Lanes3& direction, const Lanes3& across, const Lanes3& upwards, Lanes r,
                     float latest, const Lanes3& a, const Lanes3& b, const Lanes3& c) {
  const auto beside = [&](const Lanes3& axis) {
    const Lanes pa = Dot(axis, a), pb = Dot(axis, b), pc = Dot(axis, c);
    return MaxLanes(MaxLanes(MinLanes(MinLanes(pa, pb), pc), -MaxLanes(MaxLanes(pa, pb), pc)), Lanes{});
  };
  const Lanes u = beside(across), v = beside(upwards);
  const Lanes left = r * r - u * u - v * v;
  const Lanes nearest = MinLanes(MinLanes(Dot(direction, a), Dot(direction, b)), Dot(direction, c));
  return (left >= 0.0f) & (nearest - SquareRoot(MaxLanes(left, Lanes{})) <= latest);
}

// Lower bounds of the travel t at which a sphere of radius r, whose centre is t * direction, touches the
// triangles abc; kNever: not at all. `r` is a little more than the sphere's radius, by all that rounding may
// do.
Lanes EarliestTouch(const Lanes3& direction, Lanes r, Lanes slack, const Lanes3& a, const Lanes3& b,
                    const Lanes3& c) {
  const Lanes never = Lanes{} + kNever;
  const Lanes r2 = r * r;
  // Edges as capsules: where the line enters the cylinder round an edge beyond an end, only the end's sphere
  // counts.
  const auto capsule = [&](const Lanes3& p, const Lanes3& q) {
    const Lanes3 edge = q - p;
    const Lanes length = SquareRoot(Dot(edge, edge));
    const Lanes3 along = edge * (1.0f / length);
    const Lanes direction_along = Dot(direction, along), p_along = Dot(p, along);
    const Lanes across2 = 1.0f - direction_along * direction_along;
    const Lanes turn = Dot(along, Cross(p, direction));
    const Lanes inside = across2 * r2 - turn * turn;
    const Lanes across = Dot(p, direction) - p_along * direction_along;
    const Lanes at = (across - SquareRoot(MaxLanes(inside, Lanes{}))) / across2;
    const Lanes spot = at * direction_along - p_along;
    const Lanes3 end = {Select(spot < 0.5f * length, p.x, q.x), Select(spot < 0.5f * length, p.y, q.y),
                        Select(spot < 0.5f * length, p.z, q.z)};
    const Lanes3 miss = Cross(end, direction);
    const Lanes left = r2 - Dot(miss, miss);
    const Lanes at_end =
        Select(left >= 0.0f, Dot(end, direction) - SquareRoot(MaxLanes(left, Lanes{})), never);
    const Mask8 on_edge = (spot >= -slack) & (spot <= length + slack);
    Lanes entry = Select(inside >= 0.0f, Select(on_edge, MinLanes(at, at_end), at_end), never);
    // Nearly along the edge the cylinder's entry is ill-conditioned; nothing is claimed there, nor of an edge
    // that single precision hardly sees.
    return Select((across2 > 0.05f) & (length > 4 * slack), entry, Lanes{} - kNever);
  };
  Lanes earliest = MinLanes(MinLanes(capsule(a, b), capsule(b, c)), capsule(c, a));

  // Face: counted where the foot of the sphere lies inside, or near enough that rounding may say so.
  const Lanes3 ab = b - a, ac = c - a;
  Lanes3 normal = Cross(ab, ac);
  const Lanes twice_area = SquareRoot(Dot(normal, normal));
  const Lanes3 bc = c - b;
  const Lanes longest = SquareRoot(MaxLanes(MaxLanes(Dot(ab, ab), Dot(ac, ac)), Dot(bc, bc)));
  const Mask8 needle = (twice_area < 16 * slack * longest) | (twice_area < 1e-3f * longest * longest);
  // Turned along the direction: the sphere comes from the other side.
  const Lanes ahead = Select(Dot(normal, direction) < 0.0f, Lanes{} - 1.0f, Lanes{} + 1.0f);
  normal = normal * (ahead / MaxLanes(twice_area, Lanes{} + 1e-30f));
  const Lanes approach = Dot(normal, direction);
  const Lanes at = (Dot(normal, a) - r) / approach;
  const Lanes3 foot = direction * at + normal * r;
  const Lanes3 pa = a - foot, pb = b - foot, pc = c - foot;
  const Lanes margin = slack * longest / MaxLanes(approach, Lanes{} + 1e-3f);
  const auto inside = [&](const Lanes3& p, const Lanes3& q) {
    return ahead * Dot(normal, Cross(p, q)) >= -margin;
  };
  const Lanes face = Select(inside(pa, pb) & inside(pb, pc) & inside(pc, pa), at, never);
  // Towards the plane at a very flat angle the foot cannot be determined, nor the normal of a needle: no
  // claim.
  const Lanes nothing = Lanes{} - kNever;
  const Lanes flat = Select(approach < 0.02f, nothing, face);
  return Select(needle, nothing, MinLanes(flat, earliest));
}

// The search for the first contact of one sphere: what stays fixed, and the best contact so far.
class SphereSweep {
 public:
  // Lower bounds are computed about the place on the line at travel `about_m`, where the contact is expected,
  // so that coordinates there are small. `likely`: a triangle that is considered apart, or kNoTriangle.
  SphereSweep(const TriangleMesh& mesh, const Line& line, double radius_m, double slack_m, double longest_m,
              double last_m, double about_m, uint32_t likely)
      : mesh_(mesh),
        line_(line),
        radius_m_(radius_m),
        slack_m_(slack_m),
        longest_m_(longest_m),
        about_m_(about_m),
        likely_(likely),
        last_m_(last_m),
        place_(SameInAllLanes(Eigen::Vector3d(line.origin_m + about_m * line.direction).cast<float>())),
        direction_(SameInAllLanes(line.direction.cast<float>())),
        inflated_(Lanes{} + static_cast<float>(radius_m + slack_m)),
        slack_lanes_(Lanes{} + static_cast<float>(slack_m)) {
    const Eigen::Vector3d across = line.direction.unitOrthogonal();
    across_ = SameInAllLanes(across.cast<float>());
    upwards_ = SameInAllLanes(line.direction.cross(across).cast<float>());
  }

  // Later contacts are of no interest.
  double last_m() const { return last_m_; }

  // One triangle, in double precision.
  void Consider(uint32_t triangle) {
    double t = 0;
    Eigen::Vector3d touch;
    if (!SweepTriangle(line_.direction, radius_m_, mesh_.Corner(triangle, 0) - line_.origin_m,
                       mesh_.Corner(triangle, 1) - line_.origin_m, mesh_.Corner(triangle, 2) - line_.origin_m,
                       std::min(last_m_, longest_m_), &t, &touch))
      return;
    // The sooner contact wins, then (several spheres start inside the surface) the nearer spot, then the
    // triangle.
    if (best_.triangle != kNoTriangle) {
      if (t > best_.travel_m) return;
      if (t == best_.travel_m) {
        const double here = (touch - t * line_.direction).squaredNorm();
        const double there = (best_.point_m - t * line_.direction).squaredNorm();
        if (t > 0 || here == there ? triangle > best_.triangle : here > there) return;
      }
    }
    best_.travel_m = t;
    best_.point_m = touch;  // relative to the start until the end
    best_.triangle = triangle;
    last_m_ = t;
  }

  // At most eight triangles: bounds in single precision for all at once, then those that may come first.
  void ConsiderGroup(const uint32_t* ids, int count) {
    alignas(32) float corner[9][8];
    for (int i = 0; i < 8; ++i) {
      const auto& vertices = mesh_.triangles[ids[i < count ? i : 0]];
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector3f& at = mesh_.vertices_m[vertices[c]];
        for (int axis = 0; axis < 3; ++axis) corner[3 * c + axis][i] = at[axis];
      }
    }
    const auto load = [&](int c) {
      return Lanes3{LoadLanes<Lanes>(corner[3 * c]), LoadLanes<Lanes>(corner[3 * c + 1]),
                    LoadLanes<Lanes>(corner[3 * c + 2])} -
             place_;
    };
    const Lanes3 a = load(0), b = load(1), c = load(2);
    const float latest = static_cast<float>(last_m_ - about_m_ + 4 * slack_m_);
    uint32_t open = BitsOf(RoughlyReached(direction_, across_, upwards_, inflated_, latest, a, b, c)) &
                    ((1u << count) - 1);
    for (int i = 0; i < count; ++i) open &= ~(uint32_t{ids[i] == likely_} << i);
    if (open == 0) return;
    if ((open & (open - 1)) == 0) return Consider(ids[__builtin_ctz(open)]);  // a single one needs no bound
    alignas(32) float bounds[8];
    StoreLanes(bounds, EarliestTouch(direction_, inflated_, slack_lanes_, a, b, c));
    // Soonest first: often it settles the others.
    while (open) {
      int soonest = __builtin_ctz(open);
      for (uint32_t rest = open; rest; rest &= rest - 1) {
        const int lane = __builtin_ctz(rest);
        if (bounds[lane] < bounds[soonest]) soonest = lane;
      }
      if (bounds[soonest] > last_m_ - about_m_ + 4 * slack_m_) break;
      open &= ~(1u << soonest);
      Consider(ids[soonest]);
    }
  }

  // The first contact of all that were considered; its triangle is kNoTriangle if there is none.
  Contact Result() const {
    if (best_.triangle == kNoTriangle) return best_;
    Contact contact = best_;
    const Eigen::Vector3d away = best_.travel_m * line_.direction - best_.point_m;
    const double distance = std::sqrt(away.squaredNorm());
    contact.normal = distance > 0 ? Eigen::Vector3d(away / distance) : Eigen::Vector3d(-line_.direction);
    contact.point_m += line_.origin_m;
    return contact;
  }

 private:
  const TriangleMesh& mesh_;
  const Line& line_;
  const double radius_m_, slack_m_, longest_m_, about_m_;
  const uint32_t likely_;
  double last_m_;
  Contact best_ = NoSphereContact();
  const Lanes3 place_, direction_;
  Lanes3 across_, upwards_;  // with direction_, right-handed axes along and across the line
  const Lanes inflated_, slack_lanes_;
};

}  // namespace

Contact Surface::Search::SweepExactly(const Line& line, double radius_m, double longest_m,
                                      double travel_bound_m, uint32_t likely) const {
  // Boxes are searched from where the sphere comes near the mesh.
  const double to_middle = (centre_m_ - line.origin_m).dot(line.direction);
  const double around = 1.01 * reach_m_ + radius_m;
  const double first = std::max(0.0, to_middle - around);
  // The bound is met exactly where a plane is met at right angles; rounding must not make that too late.
  const double last = std::min({longest_m, travel_bound_m + 1e-7, to_middle + around});
  if (last < first) return NoSphereContact();
  const double about = std::isfinite(travel_bound_m) ? travel_bound_m : std::max(0.0, to_middle);
  const double slack = 4 * (rounding_m_ + 1e-6 * radius_m);
  SphereSweep sweep(mesh_, line, radius_m, slack, longest_m, last, about, likely);
  // What the foremost point meets is mostly what the sphere meets; its travel then excludes nearly all
  // others.
  if (likely != kNoTriangle) sweep.Consider(likely);
  tree().VisitSwept(line.origin_m + first * line.direction, line.direction, radius_m + slack,
                    sweep.last_m() - first + slack,
                    [&](const uint32_t* ids, int count, double* last_from_first) {
                      sweep.ConsiderGroup(ids, count);
                      *last_from_first = sweep.last_m() - first + slack;
                    });
  return sweep.Result();
}

void Surface::SweepSpheres(absl::Span<const Eigen::Vector3d> origins_m,
                           absl::Span<const Eigen::Vector3d> directions, double radius_m, double longest_m,
                           Contacts* contacts) const {
  TOUCHSTONE_CHECK(radius_m > 0);
  CastLines(origins_m, directions, longest_m, contacts);
  for (size_t i = 0; i < origins_m.size(); ++i) {
    if (i > 0 && SameLine(origins_m, directions, i - 1, i)) {
      CopyContact(i - 1, i, contacts);
      continue;
    }
    // The foremost point's contact, if any, comes after the sphere's.
    const double bound = contacts->triangle[i] == kNoTriangle ? std::numeric_limits<double>::infinity()
                                                              : contacts->travel_m[i];
    const Line centre = {origins_m[i] - radius_m * directions[i], directions[i]};
    Store(search_->SweepExactly(centre, radius_m, longest_m, bound, contacts->triangle[i]), i, contacts);
  }
}

}  // namespace touchstone::geometry
