// An object's outline seen from a direction, as SVG: shaded triangles, which points are hidden, where a line
// hits.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

using Vector = std::array<double, 3>;

// Where the viewer stands: degrees about z from x, degrees above the horizon.
struct View {
  double azimuth_deg, elevation_deg;
};
inline constexpr View kFrontView = {-55, 28};
inline constexpr View kBackView = {125, -28};

class ObjectPicture {
 public:
  // Side of the square picture, px.
  static constexpr double kSide = 400;

  // Without triangles, a picture of the given points alone still has a place and a scale for them.
  ObjectPicture(const v1::ObjectOutline& outline, const std::vector<Vector>& points_mm);

  struct Projected {
    double x, y, depth;  // px, px, mm towards the viewer
  };
  Projected Project(const View& view, const Vector& point_mm) const;
  // No triangle lies in front of the point by more than 4 % of the size; meshes are coarser than points.
  bool Visible(const View& view, const Vector& point_mm) const;
  // The triangles that face the viewer, back to front: paths of classes t0 (dark) to t4 (light).
  std::string Faces(const View& view) const;
  // Where the line first meets the surface; false if it misses.
  bool Hit(const Vector& from_mm, const Vector& direction, Vector* hit_mm) const;
  double size_mm() const { return size_; }

 private:
  struct Triangle {
    Vector a, b, c, normal;
  };
  std::vector<Triangle> triangles_;
  Vector centre_{};
  double size_ = 1;  // diameter of the sphere about the box's centre that holds all
};

Vector Towards(const View& view);  // unit vector towards the viewer
inline double Dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace touchstone::client
