// The body of cpu_kernels_*.cpp, compiled once per instruction set; everything stands in an anonymous namespace.
//
// Drawing: two triangles that share an edge compute it from the same corner in the same order, so that one's edge
// function is exactly the other's negative: no pixel falls between them, and one that lies exactly on the edge is in
// both, where the nearer, then the first, wins.
#ifndef TOUCHSTONE_CPU_KERNELS_TEMPLATE
#define TOUCHSTONE_CPU_KERNELS_TEMPLATE

#include "server/image/renderers/cpu_kernels.h"
#include "server/image/renderers/cpu_vectors.h"
#include "server/image/renderers/ray_triangle.h"

namespace touchstone::image {
namespace {

void Project(const ProjectionRows& rows, const DrawnMesh& mesh, const ProjectedVertices& projected) {
  const float* const r = rows.right;
  const float* const d = rows.down;
  const float* const f = rows.forward;
  const float* vertex = mesh.vertices;
  for (uint32_t i = 0; i < mesh.vertex_count; ++i, vertex += 6) {
    const float x = vertex[0], y = vertex[1], z = vertex[2];
    const float inverse_depth = 1.0f / (x * f[0] + y * f[1] + z * f[2] + f[3]);
    projected.x[i] = rows.middle_x + (x * r[0] + y * r[1] + z * r[2] + r[3]) * inverse_depth;
    projected.y[i] = rows.middle_y + (x * d[0] + y * d[1] + z * d[2] + d[3]) * inverse_depth;
    projected.inverse_depth[i] = inverse_depth;
  }
}

// Numbers of the triangles that may show, in their order: those that face the eye and whose box holds the centre of a
// pixel. Of fine meshes most do not.
uint32_t FindCandidates(const DrawnMesh& mesh, const ProjectedVertices& projected, bool outside_only,
                        const DrawTarget& target, uint32_t* candidates) {
  const float left = static_cast<float>(target.first_column),
              right = static_cast<float>(target.last_column - 1);
  const float top = static_cast<float>(target.first_row), bottom = static_cast<float>(target.last_row - 1);
  uint32_t count = 0;
  for (uint32_t first = 0; first < mesh.triangle_count; first += kWide) {
    Ints number = Steps() + static_cast<int32_t>(first);
    const Ints there = number < static_cast<int32_t>(mesh.triangle_count);
    const Ints at = there ? 3 * number : Ints{};
    const int32_t* const corners = reinterpret_cast<const int32_t*>(mesh.corners);
    const Ints a = GatherInts(corners, at), b = GatherInts(corners, at + 1), c = GatherInts(corners, at + 2);
    const Floats ax = Gather(projected.x, a), bx = Gather(projected.x, b), cx = Gather(projected.x, c);
    const Floats ay = Gather(projected.y, a), by = Gather(projected.y, b), cy = Gather(projected.y, c);
    const Floats area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    Ints shows = there & (outside_only ? area < 0.0f : area != 0.0f);
    const Floats first_column = Ceil(Min(ax, Min(bx, cx)) - 0.501f),
                 last_column = Floor(Max(ax, Max(bx, cx)) - 0.499f);
    const Floats first_row = Ceil(Min(ay, Min(by, cy)) - 0.501f),
                 last_row = Floor(Max(ay, Max(by, cy)) - 0.499f);
    shows &= (first_column <= last_column) & (first_row <= last_row);
    shows &= (first_column <= right) & (last_column >= left) & (first_row <= bottom) & (last_row >= top);
    count += AppendChosen(number, shows, candidates + count);
  }
  return count;
}

// Positive on the side of the triangle's inside: sign * ((x - from.x) * dy - (y - from.y) * dx).
struct Edge {
  float x, y, dx, dy, sign;
};
inline Edge MakeEdge(float ax, float ay, float bx, float by, float inside) {
  // From the left end to the right one, whichever triangle asks.
  if (ax > bx || (ax == bx && ay > by)) return {bx, by, ax - bx, ay - by, -inside};
  return {ax, ay, bx - ax, by - ay, inside};
}

inline float Least(float a, float b, float c) {
  const float ab = a < b ? a : b;
  return ab < c ? ab : c;
}
inline float Most(float a, float b, float c) {
  const float ab = a > b ? a : b;
  return ab > c ? ab : c;
}

// Draws one triangle, `kWide` pixels of a row at a time.
inline void DrawTriangle(const DrawnMesh& mesh, const ProjectedVertices& projected, uint32_t number,
                         const DrawTarget& target) {
  const uint32_t a = mesh.corners[3 * number], b = mesh.corners[3 * number + 1],
                 c = mesh.corners[3 * number + 2];
  const float ax = projected.x[a], bx = projected.x[b], cx = projected.x[c];
  const float ay = projected.y[a], by = projected.y[b], cy = projected.y[c];
  const float ai = projected.inverse_depth[a], bi = projected.inverse_depth[b],
              ci = projected.inverse_depth[c];
  // Pixels whose centres may lie inside.
  const int first_column = Larger(target.first_column, CeilToInt(Least(ax, bx, cx) - 0.501f));
  const int last_column = Smaller(target.last_column - 1, FloorToInt(Most(ax, bx, cx) - 0.499f));
  const int first_row = Larger(target.first_row, CeilToInt(Least(ay, by, cy) - 0.501f));
  const int last_row = Smaller(target.last_row - 1, FloorToInt(Most(ay, by, cy) - 0.499f));

  // Twice the area; rows count downwards, so that front faces are negative.
  const float area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
  const float inside = area < 0.0f ? 1.0f : -1.0f;
  const Edge ab = MakeEdge(ax, ay, bx, by, inside), bc = MakeEdge(bx, by, cx, cy, inside),
             ca = MakeEdge(cx, cy, ax, ay, inside);
  // Edge functions over the area are the weights of the corners opposite.
  const float per_area = 1.0f / (area < 0.0f ? -area : area);
  const float b_share = (bi - ai) * per_area, c_share = (ci - ai) * per_area;
  const float min_inverse = Least(ai, bi, ci), max_inverse = Most(ai, bi, ci);

  for (int row = first_row; row <= last_row; ++row) {
    const float y = static_cast<float>(row) + 0.5f;
    const float ab_y = (y - ab.y) * ab.dx, bc_y = (y - bc.y) * bc.dx, ca_y = (y - ca.y) * ca.dx;
    const int64_t start = static_cast<int64_t>(row - target.first_row) * target.stride - target.first_column;
    for (int column = first_column; column <= last_column; column += kDrawn) {
      const DrawnFloats x = DrawnSteps() + (static_cast<float>(column) + 0.5f);
      const DrawnFloats to_ab = ab.sign * ((x - ab.x) * ab.dy - ab_y);
      const DrawnFloats to_bc = bc.sign * ((x - bc.x) * bc.dy - bc_y);
      const DrawnFloats to_ca = ca.sign * ((x - ca.x) * ca.dy - ca_y);
      DrawnFloats inverse = ai + to_ca * b_share + to_ab * c_share;
      inverse = inverse < min_inverse ? DrawnFloats{} + min_inverse : inverse;
      inverse = inverse > max_inverse ? DrawnFloats{} + max_inverse : inverse;
      float* const nearest = target.nearest + start + column;
      uint32_t* const triangle = target.triangle + start + column;
      const DrawnFloats before = Load<DrawnFloats>(nearest);
      const DrawnInts drawn = (to_ab >= 0.0f) & (to_bc >= 0.0f) & (to_ca >= 0.0f) & (inverse > before);
      Save(drawn ? inverse : before, nearest);
      Save(drawn ? DrawnInts{} + static_cast<int32_t>(number) : Load<DrawnInts>(triangle), triangle);
    }
  }
}

void Draw(const DrawnMesh& mesh, const ProjectedVertices& projected, bool outside_only, uint32_t* candidates,
          const DrawTarget& target) {
  const uint32_t count = FindCandidates(mesh, projected, outside_only, target, candidates);
  for (uint32_t i = 0; i < count; ++i) DrawTriangle(mesh, projected, candidates[i], target);
}

using Vectors = Triple<Floats>;
// start + sx * right + sy * up.
inline Vectors AlongRay(const float* start, const float* right, const float* up, Floats sx, float sy) {
  return {start[0] + sx * right[0] + sy * up[0], start[1] + sx * right[1] + sy * up[1],
          start[2] + sx * right[2] + sy * up[2]};
}
// Share of a light's strength that a point with this normal of squared length `nn` gets.
inline Floats Cosine(const float* light, const Vectors& point, const Vectors& normal, Floats nn) {
  const Vectors to = {light[0] - point.x, light[1] - point.y, light[2] - point.z};
  return Max(Dot(normal, to), Floats{}) / Sqrt(nn * Dot(to, to) + 1e-30f);
}

// kWide pixels of a row from `column` on: grey levels and depths of shading.h.
inline void ShadePixels(const ShadeConstants& c, const DrawnMesh& mesh, const ShadeRow& row, int column) {
  const Ints number =
      LoadUpTo(reinterpret_cast<const int32_t*>(row.triangle) + column, row.count - column, -1);
  const Ints seen = number != -1;
  if (!Any(seen)) return;
  uint32_t vertex[3][kWide];
  for (int i = 0; i < kWide; ++i) {
    const uint32_t* const corners = mesh.corners + (seen[i] != 0 ? 3 * static_cast<uint64_t>(number[i]) : 0);
    for (int k = 0; k < 3; ++k) vertex[k][i] = corners[k];
  }
  Vectors position[3], normal[3];
  for (int k = 0; k < 3; ++k) {
    Floats fields[6];
    FetchVertices(mesh.vertices, vertex[k], fields);
    position[k] = {fields[0], fields[1], fields[2]};
    normal[k] = {fields[3], fields[4], fields[5]};
  }
  const Floats slope_x = LoadUpTo(row.slope_x + column, row.count - column, 0.0f);
  const Vectors d = AlongRay(c.forward, c.right, c.up, slope_x, row.slope_y);
  const Vectors o = AlongRay(c.start, c.start_right, c.start_up, slope_x, row.slope_y);

  const TriangleHit<Floats> hit = MeetTriangle(o, d, position[0], position[1], position[2]);
  const Floats u = hit.u, v = hit.v, w = hit.w;
  const Vectors& point = hit.point;

  // Interpolated normal, turned with the face towards the viewer.
  const Floats side = hit.determinant < 0.0f ? Floats{} + c.side_of_back : Floats{} + 1.0f;
  const Vectors n = {side * (w * normal[0].x + u * normal[1].x + v * normal[2].x),
                     side * (w * normal[0].y + u * normal[1].y + v * normal[2].y),
                     side * (w * normal[0].z + u * normal[1].z + v * normal[2].z)};
  const Floats nn = Dot(n, n);
  const Floats shade = c.ambient + c.key_strength * Cosine(c.key, point, n, nn) +
                       c.fill_strength * Cosine(c.fill, point, n, nn);
  const Ints level = __builtin_convertvector(Min(shade, Floats{} + 1.0f) * c.scale * 255.0f + 0.5f, Ints);
  if (row.grey != nullptr) SaveBytes(level, seen, row.grey + column);
  if (row.mask != nullptr) SaveBytes(Ints{} + 255, seen, row.mask + column);
  if (row.depth_m == nullptr) return;
  // Depth of that point: how far it lies along the ray.
  const Vectors beyond = {point.x - o.x, point.y - o.y, point.z - o.z};
  SaveChosen(c.start_depth_m + Dot(beyond, d) / Dot(d, d), seen, row.depth_m + column);
}

void Shade(const ShadeConstants& constants, const DrawnMesh& mesh, const ShadeRow& row) {
  for (int column = 0; column < row.count; column += kWide) ShadePixels(constants, mesh, row, column);
}

}  // namespace
}  // namespace touchstone::image

#endif  // TOUCHSTONE_CPU_KERNELS_TEMPLATE
