#include "server/geometry/shapes/supershape.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::geometry {
namespace {

struct CosSin {
  double cos = 1;
  double sin = 0;
};

// Cosine and sine of numerator / denominator of a full turn, by way of the first octant, so that quarters are
// exactly 0 and 1 and mirrored angles give mirrored values: symmetric shapes become exactly symmetric meshes.
CosSin OfTurn(uint64_t numerator, uint64_t denominator) {
  numerator %= denominator;
  const uint64_t quarter = 4 * numerator / denominator;
  const uint64_t rest = 4 * numerator - quarter * denominator;  // of a quarter turn, over denominator
  const bool mirrored = 2 * rest > denominator;
  const uint64_t folded = mirrored ? denominator - rest : rest;
  const double angle_rad = 0.5 * kPi * static_cast<double>(folded) / static_cast<double>(denominator);
  double c = std::cos(angle_rad), s = std::sin(angle_rad);
  if (2 * rest == denominator) c = s = std::sqrt(0.5);
  if (mirrored) std::swap(c, s);
  switch (quarter) {
    case 0:
      return {c, s};
    case 1:
      return {-s, c};
    case 2:
      return {-c, -s};
    default:
      return {s, -c};
  }
}

// The superformula from the cosine and sine of m angle / 4.
double RadiusOf(const Superformula& f, const CosSin& at) {
  return std::pow(std::pow(std::abs(at.cos / f.a), f.n2) + std::pow(std::abs(at.sin / f.b), f.n3),
                  -1.0 / f.n1);
}

// The radius at numerator / denominator of a turn; exact folding where m is a whole number.
double RadiusOfTurn(const Superformula& f, uint64_t numerator, uint64_t denominator) {
  if (f.m == std::floor(f.m))
    return RadiusOf(f, OfTurn(static_cast<uint64_t>(f.m) * numerator, 4 * denominator));
  return f.Radius(2 * kPi * static_cast<double>(numerator) / static_cast<double>(denominator));
}

absl::Status CheckFormula(const Superformula& f, absl::string_view which, bool goes_round) {
  const auto refuse = [&](absl::string_view name, double value, absl::string_view expected) {
    return absl::InvalidArgumentError(
        absl::StrCat("supershape: ", which, " ", name, " = ", value, "; expected ", expected));
  };
  if (!(f.m >= 0 && f.m <= 64)) return refuse("m", f.m, "0 to 64");
  if (!(f.a > 0 && f.a <= 1e3)) return refuse("a", f.a, "a number above 0, at most 1000");
  if (!(f.b > 0 && f.b <= 1e3)) return refuse("b", f.b, "a number above 0, at most 1000");
  if (!(std::abs(f.n1) <= 1e3 && std::abs(f.n1) >= 1e-3))
    return refuse("n1", f.n1, "a number but 0, at most 1000");
  if (!(f.n2 >= 0 && f.n2 <= 1e3)) return refuse("n2", f.n2, "0 to 1000");
  if (!(f.n3 >= 0 && f.n3 <= 1e3)) return refuse("n3", f.n3, "0 to 1000");
  // Round the axis the curve must meet itself: its period, 720 deg / m (360 deg / m where cosine and sine
  // play the same part), must divide the full turn.
  const bool even = f.a == f.b && f.n2 == f.n3;
  if (goes_round && f.m != std::floor(f.m))
    return refuse("m", f.m, "a whole number, so that the surface closes");
  if (goes_round && !even && std::fmod(f.m, 2) != 0)
    return refuse("m", f.m, "an even number where a, b or n2, n3 differ, so that the surface closes");
  return absl::OkStatus();
}

// The place in [lower, upper] where f is largest: a dense scan, then golden sections around the best sample.
template <typename F>
double ArgMax(double lower, double upper, F f) {
  constexpr int kSamples = 7200;
  const double step = (upper - lower) / kSamples;
  int best = 0;
  double max_value = f(lower);
  for (int i = 1; i <= kSamples; ++i)
    if (const double value = f(lower + i * step); value > max_value) max_value = value, best = i;
  double a = std::max(lower, lower + (best - 1) * step), b = std::min(upper, lower + (best + 1) * step);
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  for (int i = 0; i < 60; ++i) {
    const double c = b - golden * (b - a), d = a + golden * (b - a);
    (f(c) > f(d) ? b : a) = f(c) > f(d) ? d : c;
  }
  const double refined = 0.5 * (a + b), sample = lower + best * step;
  // A maximum at a sample itself (an edge, the equator) stays exactly there.
  return f(refined) > max_value * (1 + 1e-14) ? refined : sample;
}

// The latitude >= 0 where the surface is farthest from the axis.
double WidestLatitude(const Superformula& latitude) {
  return ArgMax(0, 0.5 * kPi, [&](double phi) { return latitude.Radius(phi) * std::cos(phi); });
}

// Lines of latitude from pole to pole, poles left out: the radius round the axis and the height of each.
struct Ring {
  double out = 0;
  double up = 0;
};

std::vector<Ring> MakeRings(const Superformula& latitude, uint32_t segments) {
  std::vector<Ring> rings(segments - 1);
  for (uint32_t k = 1; k < segments; ++k) {
    // The latitude is (k / segments - 1/2) half turns; the formula sees its absolute value.
    const int64_t doubled = 2 * static_cast<int64_t>(k) - segments;  // over 4 * segments of a turn
    const CosSin at = OfTurn(std::abs(doubled), 4 * uint64_t{segments});
    const double radius = RadiusOfTurn(latitude, std::abs(doubled), 4 * uint64_t{segments});
    rings[k - 1] = {radius * at.cos, doubled < 0 ? -radius * at.sin : radius * at.sin};
  }
  // Move the nearest lines onto the widest latitude, north and south.
  const double widest = WidestLatitude(latitude);
  const double step = kPi / segments;
  const uint32_t north = static_cast<uint32_t>(std::lround((widest + 0.5 * kPi) / step));
  const double gap = std::abs(north * step - 0.5 * kPi - widest);
  if (gap > 1e-9 * step && north >= 1 && north < segments && 2 * north > segments) {
    const double radius = latitude.Radius(widest);
    rings[north - 1] = {radius * std::cos(widest), radius * std::sin(widest)};
    rings[segments - north - 1] = {rings[north - 1].out, -rings[north - 1].up};
  }
  return rings;
}

}  // namespace

double Superformula::Radius(double angle_rad) const {
  const double angle = 0.25 * m * angle_rad;
  return RadiusOf(*this, {std::cos(angle), std::sin(angle)});
}

std::vector<std::string> SupershapeNames() {
  return {"lat00", "lat05", "lat10", "lat15", "lat20"};
}

absl::StatusOr<SupershapeParameters> NamedSupershape(const std::string& name) {
  const std::vector<std::string> names = SupershapeNames();
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end())
    return absl::NotFoundError(absl::StrCat("unknown supershape '", name, "'", DidYouMean(name, names)));
  SupershapeParameters parameters;
  parameters.latitude.n2 = 5.0 * static_cast<double>(at - names.begin());
  return parameters;
}

absl::StatusOr<double> SupershapeScaleM(const SupershapeParameters& parameters) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckFormula(parameters.longitude, "longitude", true));
  TOUCHSTONE_RETURN_IF_ERROR(CheckFormula(parameters.latitude, "latitude", false));
  if (!(parameters.width_m > 0 && parameters.width_m <= 100))
    return absl::InvalidArgumentError(
        absl::StrCat("supershape: width ", parameters.width_m, " m; expected more than 0, at most 100 m"));
  // The extents are products: the curve round the axis, times the farthest from the axis that a latitude
  // goes.
  const Superformula& round = parameters.longitude;
  const auto reach = [&](double turned_rad) {
    const auto along = [&](double theta) { return round.Radius(theta) * std::cos(theta - turned_rad); };
    return along(ArgMax(-kPi, kPi, along));
  };
  const double across = std::max(reach(0) + reach(kPi), reach(0.5 * kPi) + reach(-0.5 * kPi));
  const double widest = WidestLatitude(parameters.latitude);
  const double scale_m =
      parameters.width_m / (across * parameters.latitude.Radius(widest) * std::cos(widest));
  if (!std::isfinite(scale_m) || !(scale_m > 0))
    return absl::InvalidArgumentError("supershape: the formula gives no finite width; use smaller exponents");
  return scale_m;
}

absl::StatusOr<SupershapeSegments> SegmentsForTriangles(uint64_t triangles) {
  if (triangles < kMinSupershapeTriangles || triangles > kMaxSupershapeTriangles)
    return absl::InvalidArgumentError(absl::StrCat("supershape: ", triangles, " triangles; expected ",
                                                   kMinSupershapeTriangles, " to ", kMaxSupershapeTriangles));
  // Round the axis a multiple of 8, from pole to pole a multiple of 4; squares on a sphere would be 2 to 1.
  // No factor 3 or 5 round the axis: else meridians stand at whole degrees, where plans put their touches,
  // and every such touch would fall exactly on an edge, where the normal is a matter of rounding.
  constexpr uint64_t kCoarse = 1000;  // too few choices there
  SupershapeSegments best;
  double min_cost = 1e300;
  for (uint32_t up = 4; up <= 4096; up += 4) {
    const double wanted = static_cast<double>(triangles) / (2.0 * (up - 1));
    for (uint32_t around = 8 * static_cast<uint32_t>(wanted / 8); around <= wanted + 8; around += 8) {
      const SupershapeSegments candidate = {around, up};
      if (around < 8 || candidate.Triangles() > kMaxSupershapeTriangles) continue;
      if (triangles > kCoarse && (around % 3 == 0 || around % 5 == 0)) continue;
      const double off = std::abs(static_cast<double>(candidate.Triangles()) / triangles - 1.0);
      const double skew = std::abs(std::log(around / (2.0 * up)));
      if (const double cost = off + 0.2 * skew; cost < min_cost) min_cost = cost, best = candidate;
    }
  }
  return best;
}

absl::StatusOr<TriangleMesh> MakeSupershape(const SupershapeParameters& parameters, uint64_t triangles) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const SupershapeSegments segments, SegmentsForTriangles(triangles));
  return MakeSupershape(parameters, segments);
}

absl::StatusOr<TriangleMesh> MakeSupershape(const SupershapeParameters& parameters,
                                            const SupershapeSegments& segments) {
  const uint32_t around = segments.around, rings_count = segments.from_pole_to_pole - 1;
  if (around < 3 || segments.from_pole_to_pole < 2 || around > kMaxSupershapeTriangles ||
      segments.from_pole_to_pole > kMaxSupershapeTriangles || segments.Triangles() > kMaxSupershapeTriangles)
    return absl::InvalidArgumentError(absl::StrCat("supershape: ", around, " segments around and ",
                                                   segments.from_pole_to_pole,
                                                   " from pole to pole; expected at least "
                                                   "3 and 2, and at most ",
                                                   kMaxSupershapeTriangles, " triangles"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const double scale_m, SupershapeScaleM(parameters));

  // South pole, rings from south to north, north pole.
  std::vector<CosSin> round(around);
  for (uint32_t i = 0; i < around; ++i) {
    const double radius = RadiusOfTurn(parameters.longitude, i, around);
    const CosSin at = OfTurn(i, around);
    round[i] = {radius * at.cos, radius * at.sin};
  }
  const float pole_m = static_cast<float>(scale_m * RadiusOfTurn(parameters.latitude, 1, 4));
  TriangleMesh mesh;
  mesh.vertices_m.reserve(uint64_t{around} * rings_count + 2);
  mesh.vertices_m.emplace_back(0.0f, 0.0f, -pole_m);
  for (const Ring& ring : MakeRings(parameters.latitude, segments.from_pole_to_pole)) {
    for (const CosSin& at : round) {
      const Eigen::Vector3d place_m =
          scale_m * Eigen::Vector3d(at.cos * ring.out, at.sin * ring.out, ring.up);
      mesh.vertices_m.push_back(place_m.cast<float>() + Eigen::Vector3f::Zero());  // -0 becomes 0
    }
  }
  mesh.vertices_m.emplace_back(0.0f, 0.0f, pole_m);

  const uint32_t south = 0, north = static_cast<uint32_t>(mesh.vertices_m.size()) - 1;
  const auto vertex = [&](uint32_t ring, uint32_t i) { return 1 + ring * around + i % around; };
  mesh.triangles.reserve(segments.Triangles());
  for (uint32_t i = 0; i < around; ++i) mesh.triangles.push_back({south, vertex(0, i + 1), vertex(0, i)});
  for (uint32_t ring = 0; ring + 1 < rings_count; ++ring) {
    for (uint32_t i = 0; i < around; ++i) {
      const uint32_t a = vertex(ring, i), b = vertex(ring, i + 1), c = vertex(ring + 1, i + 1),
                     d = vertex(ring + 1, i);
      // Diagonals are mirrored across the quarters and the equator, as the shape is.
      const bool rising = (8 * uint64_t{i} / around + (2 * ring + 1 < rings_count ? 0 : 1)) % 2 == 0;
      if (rising) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
      } else {
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({b, c, d});
      }
    }
  }
  for (uint32_t i = 0; i < around; ++i)
    mesh.triangles.push_back({north, vertex(rings_count - 1, i), vertex(rings_count - 1, i + 1)});

  for (const Eigen::Vector3f& vertex_m : mesh.vertices_m)
    if (!vertex_m.allFinite())
      return absl::InvalidArgumentError(
          "supershape: the formula gives a radius that is not finite; use an even m, "
          "or exponents nearer to 1");
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    if (IsDegenerate(mesh.Corner(t, 0), mesh.Corner(t, 1), mesh.Corner(t, 2)))
      return absl::InvalidArgumentError(
          absl::StrCat("supershape: at ", mesh.triangles.size(),
                       " triangles the formula "
                       "gives some without area (the surface touches its own axis, or "
                       "is finer than single precision); use fewer triangles or "
                       "exponents nearer to 1"));
  return mesh;
}

}  // namespace touchstone::geometry
