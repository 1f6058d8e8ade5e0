// Rays through pixel centres in tiles of 4 x 4, cast by Embree as packets, then the points that they meet in loops that
// the compiler turns into vector instructions.
#include "server/image/photograph/photo_points.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <embree3/rtcore.h>

#include "server/image/photograph/photo_rays.h"
#include "server/image/renderers/ray_triangle.h"

namespace touchstone::image {
namespace {

constexpr int kPhotoTileSide = 4;

View ViewOf(const PhotoCamera& camera, int width, int height) {
  View view;
  view.width = width, view.height = height;
  view.eye_m = camera.eye_m;
  view.right = camera.right, view.up = camera.up, view.forward = camera.forward;
  view.near_m = camera.near_m, view.far_m = camera.far_m;
  view.step = 1;
  return view;
}

// The pixels whose slopes lie in the box of the object's corners.
PixelBox BoxOfSlopes(const View& view, const geometry::Bounds& bounds, const PhotoLens& lens,
                     const PixelSlopes& slopes) {
  const PixelBox whole{0, 0, lens.width, lens.height};
  Eigen::Vector2f least(1e30f, 1e30f), most(-1e30f, -1e30f);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point_m((corner & 1) ? bounds.max_m.x() : bounds.min_m.x(),
                                  (corner & 2) ? bounds.max_m.y() : bounds.min_m.y(),
                                  (corner & 4) ? bounds.max_m.z() : bounds.min_m.z());
    const double depth_m = view.DepthM(point_m);
    if (depth_m < 0.5 * view.near_m) return whole;
    const Eigen::Vector3d from_eye = point_m - view.eye_m;
    const Eigen::Vector2f slope(static_cast<float>(from_eye.dot(view.right) / depth_m),
                                static_cast<float>(from_eye.dot(view.up) / depth_m));
    least = least.cwiseMin(slope), most = most.cwiseMax(slope);
  }
  PixelBox box{lens.width, lens.height, 0, 0};
  std::vector<uint8_t> column_seen(lens.width, 0);
  for (int row = 0; row < lens.height; ++row) {
    const float* const right = &slopes.right[static_cast<size_t>(row) * lens.width];
    const float* const up = &slopes.up[static_cast<size_t>(row) * lens.width];
    uint8_t any = 0;
    for (int column = 0; column < lens.width; ++column) {
      const uint8_t inside = (right[column] >= least.x()) & (right[column] <= most.x()) &
                             (up[column] >= least.y()) & (up[column] <= most.y());
      column_seen[column] |= inside;
      any |= inside;
    }
    if (any == 0) continue;
    box.first_row = std::min(box.first_row, row);
    box.last_row = row + 1;
  }
  for (int column = 0; column < lens.width; ++column) {
    if (column_seen[column] == 0) continue;
    box.first_column = std::min(box.first_column, column);
    box.last_column = column + 1;
  }
  if (box.first_row >= box.last_row) return {0, 0, 0, 0};
  // One pixel more on each side: the corners above are rounded.
  return {std::max(0, box.first_column - 1), std::max(0, box.first_row - 1),
          std::min(lens.width, box.last_column + 1), std::min(lens.height, box.last_row + 1)};
}

// As MakeCpuFrame's, for a camera and a lens of their own. Its slopes by column and row are left empty: those of a lens
// that distorts differ from pixel to pixel.
CpuFrame MakePhotoFrame(const geometry::Surface& surface, const ShadingMesh& mesh, const PhotoCamera& camera,
                        const PhotoLens& lens, const PixelSlopes& slopes) {
  CpuFrame frame;
  frame.surface = &surface;
  frame.mesh = &mesh;
  frame.view = ViewOf(camera, lens.width, lens.height);
  frame.box = BoxOfSlopes(frame.view, surface.bounds(), lens, slopes);
  frame.middle_x = lens.cx, frame.middle_y = lens.cy;
  frame.step_x = 1 / lens.fx, frame.step_y = 1 / lens.fy;
  frame.outside_only = mesh.outward && SeesOnlyOutside(frame.view, surface.bounds());
  SetRays(&frame);
  return frame;
}

// The triangle that each pixel of the box sees, by rays.
void CastPhotoPixels(const CpuFrame& frame, const PhotoLens& lens, const PixelSlopes& slopes,
                     Visibility* visibility) {
  const PixelBox& box = frame.box;
  const RTCScene scene = static_cast<RTCScene>(frame.surface->embree_scene());
  const RayPackets packets(scene);
  const float tfar = static_cast<float>(frame.view.far_m - frame.start_depth_m);
  alignas(64) int valid[16];
  alignas(64) RTCRayHit16 rays;
  std::memset(&rays, 0, sizeof rays);
  for (int i = 0; i < 16; ++i) {
    rays.ray.tnear[i] = static_cast<float>(frame.view.near_m - frame.start_depth_m);
    rays.ray.mask[i] = 0xFFFFFFFFu;
    rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  for (int row = box.first_row; row < box.last_row; row += kPhotoTileSide) {
    for (int column = box.first_column; column < box.last_column; column += kPhotoTileSide) {
      alignas(64) float sx[16], sy[16];
      for (int i = 0; i < 16; ++i) {
        const int x = column + i % kPhotoTileSide, y = row + i / kPhotoTileSide;
        const size_t pixel = static_cast<size_t>(std::min(y, box.last_row - 1)) * lens.width +
                             std::min(x, box.last_column - 1);
        const bool sees = slopes.right[pixel] == slopes.right[pixel];
        valid[i] = x < box.last_column && y < box.last_row && sees ? -1 : 0;
        sx[i] = sees ? slopes.right[pixel] : 0.0f;
        sy[i] = sees ? slopes.up[pixel] : 0.0f;
      }
      for (int i = 0; i < 16; ++i) {
        rays.ray.org_x[i] = frame.start.x + sx[i] * frame.start_right.x + sy[i] * frame.start_up.x;
        rays.ray.org_y[i] = frame.start.y + sx[i] * frame.start_right.y + sy[i] * frame.start_up.y;
        rays.ray.org_z[i] = frame.start.z + sx[i] * frame.start_right.z + sy[i] * frame.start_up.z;
        rays.ray.dir_x[i] = frame.forward.x + sx[i] * frame.right.x + sy[i] * frame.up.x;
        rays.ray.dir_y[i] = frame.forward.y + sx[i] * frame.right.y + sy[i] * frame.up.y;
        rays.ray.dir_z[i] = frame.forward.z + sx[i] * frame.right.z + sy[i] * frame.up.z;
        rays.ray.tfar[i] = tfar;
        rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      }
      packets.Intersect(valid, &rays);
      for (int i = 0; i < 16; ++i) {
        if (valid[i] == 0 || rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
        visibility->Row(row + i / kPhotoTileSide)[column + i % kPhotoTileSide - box.first_column] =
            rays.hit.primID[i];
      }
    }
  }
}

// The pixels of the box that see a triangle, row by row.
void CollectPixels(Visibility* visibility, int width, PhotoPoints* points) {
  const PixelBox& box = visibility->box;
  const int columns = box.last_column - box.first_column;
  const size_t most = static_cast<size_t>(box.last_row - box.first_row) * columns + 1;
  points->pixel.resize(most);
  points->triangle.resize(most);
  size_t count = 0;
  for (int row = box.first_row; row < box.last_row; ++row) {
    const uint32_t* const seen = visibility->Row(row);
    const int first_pixel = row * width + box.first_column;
    const size_t before = count;
    for (int i = 0; i < columns; ++i) {
      // Always written, counted only if there is a triangle.
      points->pixel[count] = first_pixel + i;
      points->triangle[count] = seen[i];
      count += seen[i] != geometry::kNoTriangle;
    }
    if (count == before) continue;
    PixelBox& seen_box = points->box;
    if (before == 0) seen_box = {width, row, 0, row};
    seen_box.first_column = std::min(seen_box.first_column, points->pixel[before] - row * width);
    seen_box.last_column = std::max(seen_box.last_column, points->pixel[count - 1] - row * width + 1);
    seen_box.last_row = row + 1;
  }
  points->pixel.resize(count);
  points->triangle.resize(count);
}

// Corners of a block of triangles, a lane each.
struct CornerBlock {
  static constexpr int kLanes = 64;
  alignas(64) float corner[3][6][kLanes] = {};
  alignas(64) float sx[kLanes] = {}, sy[kLanes] = {};
};

// Where the ray of each lane meets its triangle, and what stands there.
void MeetTriangles(const CpuFrame& frame, float scale, const CornerBlock& block, int first,
                   PhotoPoints* points) {
  const auto& a = block.corner[0];
  const auto& b = block.corner[1];
  const auto& c = block.corner[2];
  const float start_depth_m = static_cast<float>(frame.start_depth_m);
  const float side_of_back = frame.outside_only ? 1.0f : -1.0f;
  float* const point[3] = {&points->point_m[0][first], &points->point_m[1][first],
                           &points->point_m[2][first]};
  float* const normal[3] = {&points->normal[0][first], &points->normal[1][first], &points->normal[2][first]};
  float* const face[3] = {&points->face[0][first], &points->face[1][first], &points->face[2][first]};
  float* const eye[3] = {&points->to_eye[0][first], &points->to_eye[1][first], &points->to_eye[2][first]};
  float* const depth = &points->depth_m[first];
  float* const cosine = &points->cos_incidence[first];
#pragma GCC ivdep
  for (int i = 0; i < CornerBlock::kLanes; ++i) {
    const float slope_x = block.sx[i], slope_y = block.sy[i];
    const float dx = frame.forward.x + slope_x * frame.right.x + slope_y * frame.up.x;
    const float dy = frame.forward.y + slope_x * frame.right.y + slope_y * frame.up.y;
    const float dz = frame.forward.z + slope_x * frame.right.z + slope_y * frame.up.z;
    const float ox = frame.start.x + slope_x * frame.start_right.x + slope_y * frame.start_up.x;
    const float oy = frame.start.y + slope_x * frame.start_right.y + slope_y * frame.start_up.y;
    const float oz = frame.start.z + slope_x * frame.start_right.z + slope_y * frame.start_up.z;
    const TriangleHit<float> hit =
        MeetTriangle<float>({ox, oy, oz}, {dx, dy, dz}, {a[0][i], a[1][i], a[2][i]},
                            {b[0][i], b[1][i], b[2][i]}, {c[0][i], c[1][i], c[2][i]});
    const float u = hit.u, v = hit.v, w = hit.w;
    const float x = hit.point.x, y = hit.point.y, z = hit.point.z;

    // Interpolated normal, turned with the face towards the viewer.
    const float side = hit.determinant < 0.0f ? side_of_back : 1.0f;
    const float nx = side * (w * a[3][i] + u * b[3][i] + v * c[3][i]);
    const float ny = side * (w * a[4][i] + u * b[4][i] + v * c[4][i]);
    const float nz = side * (w * a[5][i] + u * b[5][i] + v * c[5][i]);
    const float n = 1.0f / std::sqrt(nx * nx + ny * ny + nz * nz + 1e-30f);
    const float e1x = hit.e1.x, e1y = hit.e1.y, e1z = hit.e1.z;
    const float e2x = hit.e2.x, e2y = hit.e2.y, e2z = hit.e2.z;
    const float gx = e1y * e2z - e1z * e2y, gy = e1z * e2x - e1x * e2z, gz = e1x * e2y - e1y * e2x;
    const float towards = gx * dx + gy * dy + gz * dz > 0.0f ? -1.0f : 1.0f;
    const float g = towards / std::sqrt(gx * gx + gy * gy + gz * gz + 1e-30f);
    const float dd = dx * dx + dy * dy + dz * dz;
    const float d = -1.0f / std::sqrt(dd);
    point[0][i] = x, point[1][i] = y, point[2][i] = z;
    normal[0][i] = nx * n, normal[1][i] = ny * n, normal[2][i] = nz * n;
    face[0][i] = gx * g, face[1][i] = gy * g, face[2][i] = gz * g;
    eye[0][i] = dx * d, eye[1][i] = dy * d, eye[2][i] = dz * d;
    depth[i] = scale * (start_depth_m + ((x - ox) * dx + (y - oy) * dy + (z - oz) * dz) / dd);
    const float facing = (nx * dx + ny * dy + nz * dz) * n * d;
    const float low = facing > 0.0f ? facing : 0.0f;
    cosine[i] = low < 1.0f ? low : 1.0f;
  }
}

}  // namespace

PhotoCamera RealCamera(const Camera& commanded, const effects::PhotoSettings& settings,
                       const SurfacePlace& place, const geometry::Bounds& bounds) {
  ImageOptions options;
  const View view = MakeView(commanded, bounds, options);
  Eigen::Matrix3d axes;  // object_from_camera: right, down, forward
  axes.col(0) = view.right, axes.col(1) = -view.up, axes.col(2) = view.forward;
  const Eigen::Vector3d eye_m = view.eye_m + axes * settings.camera_offset_m;
  axes = place.rotation.transpose() * (axes * settings.camera_rotation);

  PhotoCamera camera;
  camera.eye_m = place.ToMesh(eye_m);
  camera.right = axes.col(0), camera.up = -axes.col(1), camera.forward = axes.col(2);
  camera.scale = place.scale;
  // The planes enclose the object from where the camera really stands.
  Camera real = commanded;
  real.eye_m = camera.eye_m, real.at_m = camera.eye_m + camera.forward, real.up = camera.up;
  real.near_m = commanded.near_m / place.scale, real.far_m = commanded.far_m / place.scale;
  const View planes = MakeView(real, bounds, options);
  camera.near_m = planes.near_m, camera.far_m = planes.far_m;
  return camera;
}

void PhotoPoints::Resize(int new_count) {
  count = new_count;
  // Whole blocks are written: room for the last one's rest.
  const size_t room = static_cast<size_t>(new_count) + CornerBlock::kLanes;
  for (auto* arrays : {&point_m, &normal, &face, &to_eye})
    for (std::vector<float>& array : *arrays) array.resize(room);
  depth_m.resize(room);
  cos_incidence.resize(room);
}

void FindPoints(const geometry::Surface& surface, const ShadingMesh& mesh, const PhotoCamera& camera,
                const PhotoLens& lens, const PixelSlopes& slopes, PhotoPoints* points) {
  const CpuFrame frame = MakePhotoFrame(surface, mesh, camera, lens, slopes);
  points->pixel.clear();
  points->triangle.clear();
  points->box = PixelBox();
  if (frame.box.first_row < frame.box.last_row) {
    Visibility visibility(frame.box);
    // Straight edges stay straight without distortion: then triangles can be drawn.
    if (!lens.Distorts() && IsCoarse(frame) && CanDrawTriangles(frame)) {
      DrawTriangles(frame, BestKernels(), &visibility);
    } else {
      CastPhotoPixels(frame, lens, slopes, &visibility);
    }
    CollectPixels(&visibility, lens.width, points);
  }
  points->Resize(static_cast<int>(points->pixel.size()));

  const auto block = std::make_unique<CornerBlock>();
  static_assert(sizeof(ShadingMesh::Vertex) == 6 * sizeof(float), "read as six floats");
  const float* const vertices = mesh.vertices.front().position_m;
  for (int first = 0; first < points->count; first += CornerBlock::kLanes) {
    const int lanes = std::min(CornerBlock::kLanes, points->count - first);
    for (int i = 0; i < lanes; ++i) {
      block->sx[i] = slopes.right[points->pixel[first + i]];
      block->sy[i] = slopes.up[points->pixel[first + i]];
      const uint32_t* const corners = &mesh.corners[3 * static_cast<size_t>(points->triangle[first + i])];
      for (int place = 0; place < 3; ++place) {
        const float* const vertex = vertices + 6 * static_cast<size_t>(corners[place]);
        for (int k = 0; k < 6; ++k) block->corner[place][k][i] = vertex[k];
      }
    }
    MeetTriangles(frame, static_cast<float>(camera.scale), *block, first, points);
  }
}

}  // namespace touchstone::image
