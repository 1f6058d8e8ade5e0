#include "client/report/svg_object.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "client/report/words.h"
#include "server/base/units.h"

namespace touchstone::client {
namespace {

Vector Minus(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

Vector Cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Distance along the line to a triangle; negative: none.
double Distance(const Vector& from, const Vector& direction, const Vector& a, const Vector& b,
                const Vector& c) {
  const Vector e1 = Minus(b, a), e2 = Minus(c, a), p = Cross(direction, e2);
  const double det = Dot(e1, p);
  if (std::abs(det) < 1e-12) return -1;
  const Vector s = Minus(from, a), q = Cross(s, e1);
  const double u = Dot(s, p) / det, v = Dot(direction, q) / det;
  return u < 0 || v < 0 || u + v > 1 ? -1 : Dot(e2, q) / det;
}

bool IsFinite(const Vector& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

Vector Towards(const View& view) {
  const double a = view.azimuth_deg * kPi / 180, e = view.elevation_deg * kPi / 180;
  return {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
}

ObjectPicture::ObjectPicture(const v1::ObjectOutline& outline, const std::vector<Vector>& points_mm) {
  std::vector<Vector> corners;
  for (int i = 0; i + 2 < outline.vertices_mm_size(); i += 3) {
    corners.push_back({outline.vertices_mm(i), outline.vertices_mm(i + 1), outline.vertices_mm(i + 2)});
  }
  Vector low{}, high{};
  bool any = false;
  for (const std::vector<Vector>* set : {static_cast<const std::vector<Vector>*>(&corners), &points_mm}) {
    // The points only count where there is no mesh.
    for (const Vector& p : *set) {
      if (!IsFinite(p)) continue;
      for (int k = 0; k < 3; ++k) {
        low[k] = any ? std::min(low[k], p[k]) : p[k];
        high[k] = any ? std::max(high[k], p[k]) : p[k];
      }
      any = true;
    }
    if (any) break;
  }
  for (int k = 0; k < 3; ++k) centre_[k] = 0.5 * (low[k] + high[k]);
  double radius = 5e-7;
  for (const std::vector<Vector>* set : {static_cast<const std::vector<Vector>*>(&corners), &points_mm}) {
    for (const Vector& p : *set) {
      const Vector out = Minus(p, centre_);
      if (IsFinite(out)) radius = std::max(radius, std::sqrt(Dot(out, out)));
    }
  }
  size_ = 2 * radius;

  double volume = 0;
  for (int i = 0; i + 2 < outline.triangles_size(); i += 3) {
    const size_t a = outline.triangles(i), b = outline.triangles(i + 1), c = outline.triangles(i + 2);
    if (std::max({a, b, c}) >= corners.size()) continue;
    if (!IsFinite(corners[a]) || !IsFinite(corners[b]) || !IsFinite(corners[c])) continue;
    Triangle triangle = {corners[a], corners[b], corners[c], {}};
    const Vector normal = Cross(Minus(triangle.b, triangle.a), Minus(triangle.c, triangle.a));
    const double length = std::sqrt(Dot(normal, normal));
    if (!(length > 0)) continue;
    for (int k = 0; k < 3; ++k) triangle.normal[k] = normal[k] / length;
    volume += Dot(Minus(triangle.a, centre_), normal);
    triangles_.push_back(triangle);
  }
  // Normals point outwards, whichever way the file winds its triangles.
  if (volume < 0) {
    for (Triangle& triangle : triangles_) {
      for (double& x : triangle.normal) x = -x;
    }
  }
}

ObjectPicture::Projected ObjectPicture::Project(const View& view, const Vector& point_mm) const {
  const double a = view.azimuth_deg * kPi / 180;
  const Vector towards = Towards(view), right = {-std::sin(a), std::cos(a), 0}, up = Cross(towards, right);
  const Vector p = Minus(point_mm, centre_);
  const double scale = 0.96 * kSide / size_;
  return {kSide / 2 + scale * Dot(p, right), kSide / 2 - scale * Dot(p, up), Dot(p, towards)};
}

bool ObjectPicture::Visible(const View& view, const Vector& point_mm) const {
  const Vector towards = Towards(view);
  for (const Triangle& t : triangles_) {
    if (Distance(point_mm, towards, t.a, t.b, t.c) > 0.04 * size_) return false;
  }
  return true;
}

std::string ObjectPicture::Faces(const View& view) const {
  struct Face {
    double depth;
    int shade;
    std::string path;
  };
  const Vector towards = Towards(view);
  const Vector light = Towards({view.azimuth_deg - 30, std::min(85.0, view.elevation_deg + 35)});
  std::vector<Face> faces;
  for (const Triangle& t : triangles_) {
    if (Dot(t.normal, towards) <= 0) continue;
    Face face = {
        0, std::clamp(static_cast<int>(5 * (0.15 + 0.85 * std::max(0.0, Dot(t.normal, light)))), 0, 4), "M"};
    for (const Vector* corner : {&t.a, &t.b, &t.c}) {
      const Projected p = Project(view, *corner);
      face.depth += p.depth;
      absl::StrAppend(&face.path,
                      corner == &t.a   ? ""
                      : corner == &t.b ? "L"
                                       : " ",
                      std::lround(p.x), " ", std::lround(p.y));
    }
    face.path += "Z";
    faces.push_back(std::move(face));
  }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.depth < b.depth; });
  std::string out;
  for (size_t i = 0; i < faces.size(); ++i) {
    const bool begins = i == 0 || faces[i].shade != faces[i - 1].shade;
    if (begins) absl::StrAppend(&out, i == 0 ? "" : "\"/>", "<path class=\"t t", faces[i].shade, "\" d=\"");
    out += faces[i].path;
  }
  return out.empty() ? out : out + "\"/>";
}

bool ObjectPicture::Hit(const Vector& from_mm, const Vector& direction, Vector* hit_mm) const {
  double nearest = -1;
  for (const Triangle& t : triangles_) {
    const double distance = Distance(from_mm, direction, t.a, t.b, t.c);
    if (distance >= 0 && (nearest < 0 || distance < nearest)) nearest = distance;
  }
  for (int k = 0; k < 3; ++k) (*hit_mm)[k] = from_mm[k] + nearest * direction[k];
  return nearest >= 0;
}

}  // namespace touchstone::client
