// First contacts of lines. Embree proposes a triangle for sixteen lines at once; travel, point and normal
// come from that triangle in double precision. A proposal is taken only where rounding cannot have changed
// it: the line stays clear of the triangle's border by more than all rounding together, and no other sheet of
// the surface comes that close. Anything else, about one line in a thousand, is searched exactly.
#include <cmath>
#include <limits>

#include "server/base/check.h"
#include "server/base/numbers/nan.h"
#include "server/geometry/surface/search.h"

namespace touchstone::geometry {
namespace {

// A proposal on a triangle met at a cosine above the first is off in travel by less than the second times the
// mesh's reach: vertices are inflated by at most 5e-5 of it, and 5e-5 / 0.02 is 0.0025.
constexpr double kFlatCosine = 0.02;
constexpr double kSlackOfReach = 0.02;

Contact NoContact() {
  return {kNaN, Eigen::Vector3d::Constant(kNaN), Eigen::Vector3d::Zero(), kNoTriangle};
}

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

// Whether lines are alike enough to be traced as one frustum. Embree 3.13 misses whole faces with a frustum
// that holds a direction component of nearly zero beside larger ones; a wide frustum is slower than none,
// too.
constexpr double kMinComponent = 1.0 / 256;
template <int kWidth>
bool RunTogether(const double (&direction)[3][kWidth]) {
  constexpr double kMaxSpread = 1.0 / 8;
  for (int axis = 0; axis < 3; ++axis) {
    double min_component = direction[axis][0], max_component = min_component;
    for (int k = 1; k < kWidth; ++k) {
      min_component = std::min(min_component, direction[axis][k]);
      max_component = std::max(max_component, direction[axis][k]);
    }
    const bool one_sign = min_component >= kMinComponent || max_component <= -kMinComponent;
    if (!one_sign || max_component - min_component > kMaxSpread) return false;
  }
  return true;
}

}  // namespace

Contact Surface::Search::CastExactly(const Line& line, double longest_m, double earliest_m) const {
  // Only the part of the line near the mesh is searched, so that coordinates stay small.
  const double to_middle = (centre_m_ - line.origin_m).dot(line.direction);
  const double first = std::max({0.0, to_middle - 1.01 * reach_m_, earliest_m});
  const Triple1 origin = ToTriple(line.origin_m), direction = ToTriple(line.direction);
  double best_travel = longest_m;
  LineTriangle<double> best_hit = {};
  uint32_t best = kNoTriangle;
  const auto consider = [&](uint32_t triangle) {
    const Triple1 a = ToTriple(mesh_.Corner(triangle, 0)) - origin,
                  b = ToTriple(mesh_.Corner(triangle, 1)) - origin,
                  c = ToTriple(mesh_.Corner(triangle, 2)) - origin;
    const LineTriangle<double> hit = IntersectTriangle(direction, a, b, c);
    if (!HitsInside(hit, direction, a, b, c) || !(hit.travel_m > 0) || !(hit.travel_m <= best_travel)) return;
    if (hit.travel_m == best_travel && best != kNoTriangle && triangle > best) return;
    best_travel = hit.travel_m;
    best_hit = hit;
    best = triangle;
  };
  const Triple<Double4> from = {Double4{} + origin.x, Double4{} + origin.y, Double4{} + origin.z};
  const Triple<Double4> along = {Double4{} + direction.x, Double4{} + direction.y, Double4{} + direction.z};
  tree().VisitAlong(
      line.origin_m + first * line.direction, line.direction, 2 * rounding_m_,
      std::min(longest_m - first, 2.02 * reach_m_) + rounding_m_,
      [&](const uint32_t* ids, int count, double* last_m) {
        // Four at a time are looked at roughly: whether the line passes within the rounding.
        // Lanes compute what plain numbers would, so a travel that comes too late needs no second look.
        for (int i = 0; i < count; i += 4) {
          alignas(32) double corner[9][4];
          for (int k = 0; k < 4; ++k) LoadCorners(ids[std::min(i + k, count - 1)], k, corner);
          const auto load = [&](int c) {
            return Triple<Double4>{LoadLanes<Double4>(corner[3 * c]), LoadLanes<Double4>(corner[3 * c + 1]),
                                   LoadLanes<Double4>(corner[3 * c + 2])} -
                   from;
          };
          const Triple<Double4> a = load(0), b = load(1), c = load(2);
          const LineTriangle<Double4> hit = IntersectTriangle(along, a, b, c);
          Mask4 near = (hit.travel_m > 0) & (hit.travel_m <= best_travel);
          for (int e = 0; e < 3; ++e) {
            const Double4 inwards = hit.facing > 0 ? hit.moment[e] : -hit.moment[e];
            near &= (inwards >= 0) |
                    (inwards * inwards <= rounding_m_ * rounding_m_ * Dot(hit.edge[e], hit.edge[e]));
          }
          for (uint32_t rest = BitsOf(near); rest; rest &= rest - 1) {
            const int k = i + __builtin_ctz(rest);
            if (k >= count || hit.travel_m[k - i] > best_travel) continue;
            if (hit.travel_m[k - i] == best_travel && best != kNoTriangle && ids[k] > best) continue;
            consider(ids[k]);
          }
        }
        // Boxes that begin a rounding later may still hold a contact that comes first.
        if (best != kNoTriangle) *last_m = std::min(*last_m, best_travel - first + 4 * rounding_m_);
      });
  if (best == kNoTriangle) return NoContact();
  return {best_travel, ToEigen(origin + direction * best_travel), ToEigen(NormalAgainst(best_hit)), best};
}

// kWidth lines on their way through Embree, coordinates by lane.
template <int kWidth>
struct Surface::Search::Packet {
  alignas(64) double origin[3][kWidth], direction[3][kWidth];
  alignas(64) double start_m[kWidth];  // travel at which the ray starts
  alignas(64) int valid[kWidth];       // as Embree wants it: -1 for rays to be cast, else 0
  alignas(64) typename EmbreePacket<kWidth>::RayHit rays;

  // Lanes beyond the last line repeat the first one.
  [[gnu::always_inline]] void Load(const Eigen::Vector3d* origins_m, const Eigen::Vector3d* directions,
                                   const uint32_t* lines, int count) {
    for (int k = 0; k < kWidth; ++k) {
      const uint32_t line = lines[k < count ? k : 0];
      for (int axis = 0; axis < 3; ++axis) {
        origin[axis][k] = origins_m[line][axis];
        direction[axis][k] = directions[line][axis];
      }
    }
  }

  bool Proposed(int k) const { return rays.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID; }
};

template <int kWidth>
[[gnu::always_inline]] inline void Surface::Search::StartRays(int count, double longest_m,
                                                              Packet<kWidth>* packet) const {
  auto& rays = packet->rays;
  const auto& origin = packet->origin;
  const auto& direction = packet->direction;
  const double reach = 1.01 * reach_m_, reach2 = reach_m_ * reach_m_;
  const double centre[3] = {centre_m_.x(), centre_m_.y(), centre_m_.z()};
  const float farthest = static_cast<float>(2.1 * reach_m_);
  for (int k = 0; k < kWidth; ++k) {
    const double ox = origin[0][k], oy = origin[1][k], oz = origin[2][k];
    const double dx = direction[0][k], dy = direction[1][k], dz = direction[2][k];
    const double cx = centre[0] - ox, cy = centre[1] - oy, cz = centre[2] - oz;
    const double to_middle = cx * dx + cy * dy + cz * dz;
    const double start = to_middle - reach;
    const double first = start > 0 ? start : 0;
    const double mx = cx - to_middle * dx, my = cy - to_middle * dy, mz = cz - to_middle * dz;
    packet->start_m[k] = first;
    const bool may_hit =
        (mx * mx + my * my + mz * mz <= reach2) & (to_middle > -reach) & (first <= longest_m);
    packet->valid[k] = may_hit ? -1 : 0;
    rays.ray.org_x[k] = static_cast<float>(ox + first * dx);
    rays.ray.org_y[k] = static_cast<float>(oy + first * dy);
    rays.ray.org_z[k] = static_cast<float>(oz + first * dz);
    rays.ray.dir_x[k] = static_cast<float>(dx);
    rays.ray.dir_y[k] = static_cast<float>(dy);
    rays.ray.dir_z[k] = static_cast<float>(dz);
    rays.ray.tnear[k] = 0;
    rays.ray.tfar[k] = farthest;
    rays.ray.time[k] = 0;
    rays.ray.mask[k] = 0xFFFFFFFFu;
    rays.ray.id[k] = 0;
    rays.ray.flags[k] = 0;
    rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
    rays.hit.primID[k] = 0;
  }
  for (int k = count; k < kWidth; ++k) packet->valid[k] = 0;
}

template <int kWidth>
[[gnu::always_inline]] inline void Surface::Search::ResolveLanes(const Packet<kWidth>& packet,
                                                                 const double (&corner)[9][kWidth], int k,
                                                                 int count, double longest_m,
                                                                 const uint32_t* lines,
                                                                 Contacts* contacts) const {
  const auto load = [&](const double(*from)[kWidth]) {
    return Triple<Double4>{LoadLanes<Double4>(from[0] + k), LoadLanes<Double4>(from[1] + k),
                           LoadLanes<Double4>(from[2] + k)};
  };
  const Double4 clear = Double4{} + 2 * rounding_m_;
  const Triple<Double4> from = load(packet.origin), along = load(packet.direction);
  const Triple<Double4> a = load(corner) - from, b = load(corner + 3) - from, c = load(corner + 6) - from;
  const LineTriangle<Double4> hit = IntersectTriangle(along, a, b, c);
  const Double4 side = hit.facing > 0 ? Double4{} + 1.0 : Double4{} - 1.0;
  const auto clears = [&](int i) {
    const Double4 inwards = hit.moment[i] * side;
    return (inwards > 0) & (inwards * inwards > clear * clear * Dot(hit.edge[i], hit.edge[i]));
  };
  const Mask4 certain =
      clears(0) & clears(1) & clears(2) & (hit.travel_m > clear) & (hit.travel_m <= longest_m);
  const Triple<Double4> normal = NormalAgainst(hit);
  const Triple<Double4> point = from + along * hit.travel_m;
  const uint32_t certain_bits = BitsOf(certain);
  for (int lane = 0; lane < std::min(4, count - k); ++lane) {
    const uint32_t triangle = packet.rays.hit.primID[k + lane];
    const uint32_t to = lines[k + lane];
    if (packet.valid[k + lane] == 0) {
      Store(NoContact(), to, contacts);
    } else if (packet.Proposed(k + lane) && (certain_bits >> lane & 1) && !NearCoincident(triangle)) {
      contacts->travel_m[to] = hit.travel_m[lane];
      contacts->point_m[to] = {point.x[lane], point.y[lane], point.z[lane]};
      contacts->normal[to] = {normal.x[lane], normal.y[lane], normal.z[lane]};
      contacts->triangle[to] = triangle;
    } else {
      // A proposal bounds the search from below: the inflated surface that Embree sees is hit no later than
      // the real one, but for a little that matters only at flat angles.
      double earliest_m = 0;
      if (packet.Proposed(k + lane)) {
        const double cosine = std::abs(normal.x[lane] * along.x[lane] + normal.y[lane] * along.y[lane] +
                                       normal.z[lane] * along.z[lane]);
        if (cosine > kFlatCosine)
          earliest_m = packet.start_m[k + lane] + static_cast<double>(packet.rays.ray.tfar[k + lane]) -
                       kSlackOfReach * reach_m_;
      }
      const Line line = {
          {packet.origin[0][k + lane], packet.origin[1][k + lane], packet.origin[2][k + lane]},
          {packet.direction[0][k + lane], packet.direction[1][k + lane], packet.direction[2][k + lane]}};
      Store(CastExactly(line, longest_m, earliest_m), to, contacts);
    }
  }
}

template <int kWidth>
void Surface::Search::CastPacket(const Eigen::Vector3d* origins_m, const Eigen::Vector3d* directions,
                                 const uint32_t* lines, int count, double longest_m,
                                 Contacts* contacts) const {
  Packet<kWidth> packet;
  packet.Load(origins_m, directions, lines, count);
  StartRays(count, longest_m, &packet);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RunTogether<kWidth>(packet.direction) ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                        : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  EmbreePacket<kWidth>::Intersect(packet.valid, scene_, &context, &packet.rays);

  alignas(64) double corner[9][kWidth];  // of the proposed triangles, by lane
  for (int k = 0; k < kWidth; ++k) LoadCorners(packet.rays.hit.primID[k], k, corner);
  for (int k = 0; k < count; k += 4) ResolveLanes(packet, corner, k, count, longest_m, lines, contacts);
}

template <int kWidth>
void Surface::Search::CastPackets(absl::Span<const Eigen::Vector3d> origins_m,
                                  absl::Span<const Eigen::Vector3d> directions, double longest_m,
                                  Contacts* contacts) const {
  const uint32_t size = static_cast<uint32_t>(origins_m.size());
  if (size == 0) return;
  // Lines that no frustum may hold travel apart, so that they do not keep their neighbours from being one.
  // Whether a line repeats the one before cannot be foreseen, so nothing branches on it.
  std::vector<uint32_t> together(size), apart(size);
  std::vector<uint8_t> repeats(size);
  uint32_t together_count = 0, apart_count = 0;
  for (uint32_t line = 0; line < size; ++line) {
    const bool first = line == 0 || !SameLine(origins_m, directions, line - 1, line);
    repeats[line] = !first;
    const bool flat = directions[line].cwiseAbs().minCoeff() < kMinComponent;
    together[together_count] = line;
    together_count += first & !flat;
    apart[apart_count] = line;
    apart_count += first & flat;
  }
  const auto cast = [&](const std::vector<uint32_t>& lines, uint32_t count) {
    for (uint32_t at = 0; at < count; at += kWidth)
      CastPacket<kWidth>(origins_m.data(), directions.data(), &lines[at],
                         static_cast<int>(std::min<uint32_t>(kWidth, count - at)), longest_m, contacts);
  };
  cast(together, together_count);
  cast(apart, apart_count);
  if (together_count + apart_count == size) return;
  for (uint32_t line = 1; line < size; ++line) CopyContact(line - repeats[line], line, contacts);
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

}  // namespace touchstone::geometry
