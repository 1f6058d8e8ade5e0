// First contacts of lines. Embree proposes a triangle for sixteen lines at once; travel, point and normal come
// from that triangle in double precision. A proposal is taken only where rounding cannot have changed it: the
// line stays clear of the triangle's border by more than all rounding together, and no other sheet of the surface
// comes that close. Anything else, about one line in a thousand, is searched exactly.
#include <cmath>
#include <limits>

#include "server/base/check.h"
#include "server/geometry/search.h"

namespace touchstone {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Contact NoContact() { return {kNaN, Eigen::Vector3d::Constant(kNaN), Eigen::Vector3d::Zero(), kNoTriangle}; }

template <int kWidth>
struct EmbreePacket;
template <>
struct EmbreePacket<16> {
  using RayHit = RTCRayHit16;
  static void Intersect(const int* valid, RTCScene scene, RTCIntersectContext* context, RayHit* rays) {
    rtcIntersect16(valid, scene, context, rays);
  }
};
template <>
struct EmbreePacket<8> {
  using RayHit = RTCRayHit8;
  static void Intersect(const int* valid, RTCScene scene, RTCIntersectContext* context, RayHit* rays) {
    rtcIntersect8(valid, scene, context, rays);
  }
};
template <>
struct EmbreePacket<4> {
  using RayHit = RTCRayHit4;
  static void Intersect(const int* valid, RTCScene scene, RTCIntersectContext* context, RayHit* rays) {
    rtcIntersect4(valid, scene, context, rays);
  }
};

}  // namespace

Contact Surface::Search::CastExactly(const Line& line, double longest_m) const {
  // Only the part of the line near the mesh is searched, so that coordinates stay small.
  const double to_middle = (centre_m_ - line.origin_m).dot(line.direction);
  const double first = std::max(0.0, to_middle - 1.01 * reach_m_);
  double best_travel = longest_m;
  LineTriangle best_meet;
  uint32_t best = kNoTriangle;
  tree().VisitAlong(
      line.origin_m + first * line.direction, line.direction, rounding_m_, 0,
      std::min(longest_m - first, 2.02 * reach_m_) + rounding_m_,
      [&](const uint32_t* ids, int count, double* last_m) {
        for (int i = 0; i < count; ++i) {
          const LineTriangle meet = MeetTriangle(line.direction, mesh_.Corner(ids[i], 0) - line.origin_m,
                                                 mesh_.Corner(ids[i], 1) - line.origin_m,
                                                 mesh_.Corner(ids[i], 2) - line.origin_m);
          if (!meet.Inside() || !(meet.travel_m > 0) || !(meet.travel_m <= best_travel)) continue;
          if (meet.travel_m == best_travel && best != kNoTriangle && ids[i] > best) continue;
          best_travel = meet.travel_m;
          best_meet = meet;
          best = ids[i];
        }
        // Boxes that begin a rounding later may still hold a contact that comes first.
        if (best != kNoTriangle) *last_m = std::min(*last_m, best_travel - first + 4 * rounding_m_);
      });
  if (best == kNoTriangle) return NoContact();
  return {best_travel, line.origin_m + best_travel * line.direction, NormalAgainst(best_meet), best};
}

template <int kWidth>
void Surface::Search::CastPacket(const Eigen::Vector3d* origins_m, const Eigen::Vector3d* directions, int count,
                                 double longest_m, size_t at, Contacts* contacts) const {
  // Rays start where the line enters a ball round the mesh: standing far away costs no precision.
  alignas(64) typename EmbreePacket<kWidth>::RayHit rays;
  alignas(64) int valid[kWidth];
  for (int k = 0; k < kWidth; ++k) {
    const Eigen::Vector3d& origin = origins_m[k < count ? k : 0];
    const Eigen::Vector3d& direction = directions[k < count ? k : 0];
    const Eigen::Vector3d to_centre = centre_m_ - origin;
    const double to_middle = to_centre.dot(direction);
    const double first = std::max(0.0, to_middle - 1.01 * reach_m_);
    const bool may_meet = (to_centre - to_middle * direction).squaredNorm() <= reach_m_ * reach_m_ &&
                          to_middle > -reach_m_ && first <= longest_m;
    valid[k] = k < count && may_meet ? -1 : 0;
    rays.ray.org_x[k] = static_cast<float>(origin.x() + first * direction.x());
    rays.ray.org_y[k] = static_cast<float>(origin.y() + first * direction.y());
    rays.ray.org_z[k] = static_cast<float>(origin.z() + first * direction.z());
    rays.ray.dir_x[k] = static_cast<float>(direction.x());
    rays.ray.dir_y[k] = static_cast<float>(direction.y());
    rays.ray.dir_z[k] = static_cast<float>(direction.z());
    rays.ray.tnear[k] = 0;
    rays.ray.tfar[k] = static_cast<float>(2.1 * reach_m_);
    rays.ray.time[k] = 0;
    rays.ray.mask[k] = 0xFFFFFFFFu;
    rays.ray.id[k] = 0;
    rays.ray.flags[k] = 0;
    rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    rays.hit.primID[k] = 0;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  EmbreePacket<kWidth>::Intersect(valid, scene_, &context, &rays);

  const double clear = 2 * rounding_m_;
  for (int k = 0; k < count; ++k) {
    if (valid[k] == 0) {
      Store(NoContact(), at + k, contacts);
      continue;
    }
    const Eigen::Vector3d& origin = origins_m[k];
    const Eigen::Vector3d& direction = directions[k];
    const uint32_t triangle = rays.hit.primID[k];
    bool certain = rays.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
    if (certain) {
      const Eigen::Vector3d a = mesh_.Corner(triangle, 0) - origin, b = mesh_.Corner(triangle, 1) - origin,
                            c = mesh_.Corner(triangle, 2) - origin;
      const LineTriangle meet = MeetTriangle(direction, a, b, c);
      // moment / edge length is at most the distance between the line and the edge's line.
      const double side = meet.facing > 0 ? -1 : 1;
      const double m0 = side * meet.moment[0], m1 = side * meet.moment[1], m2 = side * meet.moment[2];
      const double clear2 = clear * clear;
      certain = m0 > 0 && m1 > 0 && m2 > 0 && m0 * m0 > clear2 * (c - b).squaredNorm() &&
                m1 * m1 > clear2 * (a - c).squaredNorm() && m2 * m2 > clear2 * (b - a).squaredNorm() &&
                meet.travel_m > clear && meet.travel_m <= longest_m && !Crowded(triangle);
      if (certain) {
        contacts->travel_m[at + k] = meet.travel_m;
        contacts->point_m[at + k] = origin + meet.travel_m * direction;
        contacts->normal[at + k] = NormalAgainst(meet);
        contacts->triangle[at + k] = triangle;
      }
    }
    if (!certain) Store(CastExactly({origin, direction}, longest_m), at + k, contacts);
  }
}

template <int kWidth>
void Surface::Search::CastPackets(absl::Span<const Eigen::Vector3d> origins_m,
                                  absl::Span<const Eigen::Vector3d> directions, double longest_m,
                                  Contacts* contacts) const {
  for (size_t at = 0; at < origins_m.size(); at += kWidth) {
    const int count = static_cast<int>(std::min<size_t>(kWidth, origins_m.size() - at));
    CastPacket<kWidth>(&origins_m[at], &directions[at], count, longest_m, at, contacts);
  }
}

void Surface::Search::Cast(absl::Span<const Eigen::Vector3d> origins_m,
                           absl::Span<const Eigen::Vector3d> directions, double longest_m,
                           Contacts* contacts) const {
  TOUCHSTONE_CHECK(origins_m.size() == directions.size());
  switch (EmbreePacketWidth()) {
    case 16:
      return CastPackets<16>(origins_m, directions, longest_m, contacts);
    case 8:
      return CastPackets<8>(origins_m, directions, longest_m, contacts);
    default:
      return CastPackets<4>(origins_m, directions, longest_m, contacts);
  }
}

}  // namespace touchstone
