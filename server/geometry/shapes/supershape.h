// Gielis supershapes: closed surfaces made of two superformulas, one round the z axis, one from pole to pole.
//   r(angle) = (|cos(m angle / 4) / a|^n2 + |sin(m angle / 4) / b|^n3)^(-1 / n1)
//   x = r1(theta) cos(theta) r2(phi) cos(phi)      theta, longitude, from -180 to 180 deg
//   y = r1(theta) sin(theta) r2(phi) cos(phi)      phi, latitude, from -90 to 90 deg
//   z =                      r2(phi) sin(phi)
// J. Gielis, "A generic geometric transformation that unifies a wide range of natural and abstract shapes",
// American Journal of Botany 90(3), 2003. 0^0 is 1, so that n2 = 0 is continuous at the poles.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

struct Superformula {
  double m = 4;  // symmetry
  double n1 = 10;
  double n2 = 10;
  double n3 = 10;
  double a = 1;
  double b = 1;

  double Radius(double angle_rad) const;
};

struct SupershapeParameters {
  Superformula longitude;
  Superformula latitude;
  // The surface is scaled uniformly so that the larger of its extents along x and y is this: of the surface
  // itself, whatever its tessellation.
  double width_m = 0.150;
};

// lat00, lat05, lat10, lat15, lat20: n2 of the latitude is 0, 5, 10, 15, 20; everything else is the default.
std::vector<std::string> SupershapeNames();
absl::StatusOr<SupershapeParameters> NamedSupershape(const std::string& name);

// Metres per unit of the formula: what makes the surface width_m wide.
absl::StatusOr<double> SupershapeScaleM(const SupershapeParameters& parameters);

// Longitude and latitude steps. The mesh has 2 * around * (from_pole_to_pole - 1) triangles.
struct SupershapeSegments {
  uint32_t around = 0;             // >= 3
  uint32_t from_pole_to_pole = 0;  // >= 2
  uint64_t Triangles() const { return uint64_t{2} * around * (from_pole_to_pole - 1); }
};

inline constexpr uint64_t kMinSupershapeTriangles = 48;
inline constexpr uint64_t kMaxSupershapeTriangles = 4'000'000;

// The tessellation nearest to a number of triangles (20,000 gives 20,368), with steps of about the same size
// both ways, lines on the equator, on every quarter and between two quarters, where the built-in shapes have
// their edges. Never more than kMaxSupershapeTriangles.
absl::StatusOr<SupershapeSegments> SegmentsForTriangles(uint64_t triangles);

// The mesh: closed, wound outwards, each pole one vertex, without degenerate or duplicate triangles. The
// latitude lines nearest to the widest place are moved onto it, so that the mesh is as wide as the surface.
// Fails where the formula does not give a radius, or a surface without such a mesh.
absl::StatusOr<TriangleMesh> MakeSupershape(const SupershapeParameters& parameters, uint64_t triangles);
absl::StatusOr<TriangleMesh> MakeSupershape(const SupershapeParameters& parameters,
                                            const SupershapeSegments& segments);

// What WriteSupershapeFolder writes, by file name: the named shapes at 20,000 triangles as OFF and OBJ, and
// manifest.json.
inline constexpr uint64_t kSupershapeFolderTriangles = 20'000;
struct NamedText {
  std::string file;
  std::string text;
};
absl::StatusOr<std::vector<NamedText>> SupershapeFolderFiles();
absl::Status WriteSupershapeFolder(const std::string& folder);

}  // namespace touchstone::geometry
