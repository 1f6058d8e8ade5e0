// The CPU renderer: primary rays through pixel centres in tiles of 4 x 4, cast by Embree as packets.
//
// Embree only says which triangle a ray meets. Where on it is computed again here, from the triangle, in
// single precision without fused operations: so grey levels and depths do not hang on Embree's instruction
// set or packet width. (Which of two triangles a ray through their common edge meets still may.)
//
// One call runs on the calling thread; callers draw several images at once for more speed.
#include <algorithm>
#include <cmath>
#include <cstring>

#include <absl/strings/str_cat.h>
#include <embree3/rtcore.h>

#include "server/base/status.h"
#include "server/image/renderer.h"
#include "server/image/shading.h"
#include "server/image/shading_mesh.h"
#include "server/image/view.h"

namespace touchstone {
namespace {

constexpr int kTileSide = 4;
constexpr int kLanes = kTileSide * kTileSide;

struct Vec3f {
  float x, y, z;
};
Vec3f ToFloat(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

// All that stays the same over one image. Rays start on the near plane: their origins are then of the
// object's size, however far away the eye is, and single precision suffices.
struct Frame {
  RTCScene scene;
  bool packets_of_16;
  const float* vertices;  // ShadingMesh::Vertex as six floats each
  const int* corners;
  bool two_sided;
  Vec3f forward, right, up;            // direction = forward + sx * right + sy * up
  Vec3f start, start_right, start_up;  // origin = start + sx * start_right + sy * start_up
  float length;                        // from the near plane to the far one, in depth
  std::vector<float> sx, sy;           // by column and by row
  Lighting lighting;
};

Frame MakeFrame(const Surface& surface, const ShadingMesh& mesh, const View& view, Look look) {
  Frame frame;
  frame.scene = static_cast<RTCScene>(surface.embree_scene());
  const RTCDevice device = rtcGetSceneDevice(frame.scene);
  frame.packets_of_16 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  rtcReleaseDevice(device);
  static_assert(sizeof(ShadingMesh::Vertex) == 6 * sizeof(float), "gathered as six floats");
  frame.vertices = mesh.vertices.front().position_m;
  frame.corners = reinterpret_cast<const int*>(mesh.corners.data());
  frame.two_sided = !mesh.outward || !SeesOnlyOutside(view, surface.bounds());
  frame.forward = ToFloat(view.forward);
  frame.right = ToFloat(view.right);
  frame.up = ToFloat(view.up);
  frame.start = ToFloat(view.eye_m + view.near_m * view.forward);
  frame.start_right = ToFloat(view.near_m * view.right);
  frame.start_up = ToFloat(view.near_m * view.up);
  frame.length = static_cast<float>(view.far_m - view.near_m);
  frame.sx.resize(view.width);
  frame.sy.resize(view.height);
  for (int x = 0; x < view.width; ++x)
    frame.sx[x] = static_cast<float>((x + 0.5 - 0.5 * view.width) * view.step);
  for (int y = 0; y < view.height; ++y)
    frame.sy[y] = static_cast<float>((0.5 * view.height - y - 0.5) * view.step);
  frame.lighting = MakeLighting(view, surface.bounds(), look);
  return frame;
}

// The rays and results of one tile, a lane a pixel, row by row.
struct Tile {
  alignas(64) int valid[kLanes];  // -1: lies in the image; as Embree wants it
  alignas(64) RTCRayHit16 rays;
  alignas(64) float depth[kLanes];  // beyond the near plane
  alignas(64) int level[kLanes];    // grey
  alignas(64) int hit[kLanes];      // 1 or 0
};

// Fills origins and directions. Lanes beyond the image repeat its last column and row, and are not valid.
void MakeRays(const Frame& frame, int column, int row, Tile* tile) {
  const int width = static_cast<int>(frame.sx.size()), height = static_cast<int>(frame.sy.size());
  alignas(64) float sx[kLanes], sy[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const int x = column + i % kTileSide, y = row + i / kTileSide;
    tile->valid[i] = x < width && y < height ? -1 : 0;
    sx[i] = frame.sx[std::min(x, width - 1)];
    sy[i] = frame.sy[std::min(y, height - 1)];
  }
  RTCRay16& ray = tile->rays.ray;
  for (int i = 0; i < kLanes; ++i) {
    ray.org_x[i] = frame.start.x + sx[i] * frame.start_right.x + sy[i] * frame.start_up.x;
    ray.org_y[i] = frame.start.y + sx[i] * frame.start_right.y + sy[i] * frame.start_up.y;
    ray.org_z[i] = frame.start.z + sx[i] * frame.start_right.z + sy[i] * frame.start_up.z;
    ray.dir_x[i] = frame.forward.x + sx[i] * frame.right.x + sy[i] * frame.up.x;
    ray.dir_y[i] = frame.forward.y + sx[i] * frame.right.y + sy[i] * frame.up.y;
    ray.dir_z[i] = frame.forward.z + sx[i] * frame.right.z + sy[i] * frame.up.z;
    ray.tnear[i] = 0.0f;
    ray.tfar[i] = frame.length;
    ray.time[i] = 0.0f;
    ray.mask[i] = 0xFFFFFFFFu;
    ray.id[i] = 0;
    ray.flags[i] = 0;
    tile->rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    tile->rays.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;
    tile->rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

// For processors without 512-bit vectors: the tile's two halves.
void CastHalves(const Frame& frame, RTCIntersectContext* context, Tile* tile) {
  for (int first = 0; first < kLanes; first += 8) {
    alignas(32) RTCRayHit8 half;
    const RTCRay16& ray = tile->rays.ray;
    for (int i = 0; i < 8; ++i) {
      half.ray.org_x[i] = ray.org_x[first + i];
      half.ray.org_y[i] = ray.org_y[first + i];
      half.ray.org_z[i] = ray.org_z[first + i];
      half.ray.dir_x[i] = ray.dir_x[first + i];
      half.ray.dir_y[i] = ray.dir_y[first + i];
      half.ray.dir_z[i] = ray.dir_z[first + i];
      half.ray.tnear[i] = ray.tnear[first + i];
      half.ray.tfar[i] = ray.tfar[first + i];
      half.ray.time[i] = 0.0f;
      half.ray.mask[i] = 0xFFFFFFFFu;
      half.ray.id[i] = 0;
      half.ray.flags[i] = 0;
      half.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      half.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;
      half.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(tile->valid + first, frame.scene, context, &half);
    for (int i = 0; i < 8; ++i) {
      tile->rays.hit.geomID[first + i] = half.hit.geomID[i];
      tile->rays.hit.primID[first + i] = half.hit.primID[i];
    }
  }
}

// Grey levels and depths of the lanes whose hit triangle is known. One loop without branches over all lanes,
// so that the compiler turns it into vector instructions; lanes without a hit compute on triangle 0 for
// nothing.
void Shade(const Frame& frame, Tile* tile) {
  static_assert(kLights.size() == 2, "the lights are spelt out for the compiler's vectoriser");
  const RTCRay16& ray = tile->rays.ray;
  const float* const vertices = frame.vertices;
  const int* const corners = frame.corners;
  const float side_of_back = frame.two_sided ? -1.0f : 1.0f;
  const float key_x = frame.lighting.position_m[0][0], key_y = frame.lighting.position_m[0][1],
              key_z = frame.lighting.position_m[0][2];
  const float fill_x = frame.lighting.position_m[1][0], fill_y = frame.lighting.position_m[1][1],
              fill_z = frame.lighting.position_m[1][2];
  const float scale = frame.lighting.scale;

  alignas(64) int triangle[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const bool hit = tile->rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    tile->hit[i] = hit;
    triangle[i] = hit ? 3 * static_cast<int>(tile->rays.hit.primID[i]) : 0;
  }
  for (int i = 0; i < kLanes; ++i) {
    const int a = 6 * corners[triangle[i]], b = 6 * corners[triangle[i] + 1],
              c = 6 * corners[triangle[i] + 2];
    const float ax = vertices[a], ay = vertices[a + 1], az = vertices[a + 2];
    const float e1x = vertices[b] - ax, e1y = vertices[b + 1] - ay, e1z = vertices[b + 2] - az;
    const float e2x = vertices[c] - ax, e2y = vertices[c + 1] - ay, e2z = vertices[c + 2] - az;

    // Where the ray meets the triangle's plane (Moeller and Trumbore 1997), kept inside the triangle.
    const float dx = ray.dir_x[i], dy = ray.dir_y[i], dz = ray.dir_z[i];
    const float px = dy * e2z - dz * e2y, py = dz * e2x - dx * e2z, pz = dx * e2y - dy * e2x;
    const float determinant = e1x * px + e1y * py + e1z * pz;
    const float inverse = 1.0f / (determinant == 0.0f ? 1e-30f : determinant);
    const float sx = ray.org_x[i] - ax, sy = ray.org_y[i] - ay, sz = ray.org_z[i] - az;
    float u = (sx * px + sy * py + sz * pz) * inverse;
    const float qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
    float v = (dx * qx + dy * qy + dz * qz) * inverse;
    u = std::min(std::max(u, 0.0f), 1.0f);
    v = std::min(std::max(v, 0.0f), 1.0f - u);

    // Interpolated point and normal; the face towards the viewer.
    const float w = 1.0f - u - v;
    const float side = determinant < 0.0f ? side_of_back : 1.0f;
    const float nx = side * (w * vertices[a + 3] + u * vertices[b + 3] + v * vertices[c + 3]);
    const float ny = side * (w * vertices[a + 4] + u * vertices[b + 4] + v * vertices[c + 4]);
    const float nz = side * (w * vertices[a + 5] + u * vertices[b + 5] + v * vertices[c + 5]);
    const float x = ax + u * e1x + v * e2x, y = ay + u * e1y + v * e2y, z = az + u * e1z + v * e2z;
    const float nn = nx * nx + ny * ny + nz * nz;

    // Two point lights.
    float shade = kAmbient;
    const float kx = key_x - x, ky = key_y - y, kz = key_z - z;
    const float key = std::max(nx * kx + ny * ky + nz * kz, 0.0f);
    shade += kLights[0].strength * (key / std::sqrt(nn * (kx * kx + ky * ky + kz * kz) + 1e-30f));
    const float fx = fill_x - x, fy = fill_y - y, fz = fill_z - z;
    const float fill = std::max(nx * fx + ny * fy + nz * fz, 0.0f);
    shade += kLights[1].strength * (fill / std::sqrt(nn * (fx * fx + fy * fy + fz * fz) + 1e-30f));
    tile->level[i] = static_cast<int>(std::min(shade, 1.0f) * scale * 255.0f + 0.5f);

    // Depth of that point beyond the near plane: the mean of its parts along the ray.
    const float ox = x - ray.org_x[i], oy = y - ray.org_y[i], oz = z - ray.org_z[i];
    tile->depth[i] = (ox * dx + oy * dy + oz * dz) / (dx * dx + dy * dy + dz * dz);
  }
}

// Copies the tile's lanes that lie in the image and hit.
void Store(const Tile& tile, const View& view, int channels, int column, int row, Image* image) {
  const int columns = std::min(kTileSide, view.width - column), rows = std::min(kTileSide, view.height - row);
  const float near_m = static_cast<float>(view.near_m);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const int lane = y * kTileSide + x;
      if (!tile.hit[lane]) continue;
      const size_t pixel = static_cast<size_t>(row + y) * view.width + (column + x);
      for (int channel = 0; channel < channels; ++channel)
        image->pixels[pixel * channels + channel] = static_cast<uint8_t>(tile.level[lane]);
      if (!image->depth_m.empty()) image->depth_m[pixel] = near_m + tile.depth[lane];
      if (!image->mask.empty()) image->mask[pixel] = 255;
    }
  }
}

class CpuRenderer final : public Renderer {
 public:
  std::string name() const override { return "cpu"; }
  std::string description() const override { return absl::StrCat("CPU, ray packets: ", EmbreeDescription()); }

  absl::StatusOr<Image> Render(const std::shared_ptr<const Surface>& surface, const Camera& camera,
                               const ImageOptions& options) override {
    TOUCHSTONE_RETURN_IF_ERROR(ValidateImageRequest(camera, options));
    const std::shared_ptr<const ShadingMesh> mesh = meshes_.Get(surface);
    const View view = MakeView(camera, surface->bounds(), options);
    const Frame frame = MakeFrame(*surface, *mesh, view, options.look);

    Image image;
    image.width = options.width;
    image.height = options.height;
    image.channels = options.format == PixelFormat::kRgb ? 3 : 1;
    const size_t pixels = static_cast<size_t>(options.width) * options.height;
    image.pixels.assign(pixels * image.channels, frame.lighting.background);
    if (options.depth) image.depth_m.assign(pixels, 0.0f);
    if (options.mask) image.mask.assign(pixels, 0);

    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;

    // Only the tiles that the object's box can cover.
    const PixelBox box = ProjectBounds(view, surface->bounds());
    Tile tile;
    for (int row = box.first_row / kTileSide * kTileSide; row < box.last_row; row += kTileSide) {
      for (int column = box.first_column / kTileSide * kTileSide; column < box.last_column;
           column += kTileSide) {
        MakeRays(frame, column, row, &tile);
        if (frame.packets_of_16) {
          rtcIntersect16(tile.valid, frame.scene, &context, &tile.rays);
        } else {
          CastHalves(frame, &context, &tile);
        }
        bool any = false;
        for (int i = 0; i < kLanes; ++i) any |= tile.rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
        if (!any) continue;
        Shade(frame, &tile);
        Store(tile, view, image.channels, column, row, &image);
      }
    }
    return image;
  }

 private:
  ShadingMeshCache meshes_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<Renderer>> CreateCpuRenderer() {
  return std::shared_ptr<Renderer>(std::make_shared<CpuRenderer>());
}

}  // namespace touchstone
