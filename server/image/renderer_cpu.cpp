// The CPU renderer: primary rays through pixel centres in tiles of 4 x 4, cast by Embree as packets.
//
// Embree only says which triangle a ray meets. Where on it is computed again here, from the triangle, in
// single precision without fused operations: so grey levels and depths do not hang on Embree's instruction
// set or packet width. (Which of two triangles a ray through their common edge meets still may.)
//
// Hits are collected over several tiles and shaded together, in loops that the compiler turns into vector
// instructions. One call runs on the calling thread; callers draw several images at once for more speed.
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

constexpr int kTileWidth = 4;
constexpr int kTileHeight = 4;
constexpr int kLanes = kTileWidth * kTileHeight;

// A tile's lanes run row by row: the first eight are its upper half.
constexpr int LaneColumn(int lane) {
  return lane % kTileWidth;
}
constexpr int LaneRow(int lane) {
  return lane / kTileWidth;
}

struct Vec3f {
  float x, y, z;
};
// By value, unlike std::min: what the vectoriser understands.
float Least(float a, float b) {
  return a < b ? a : b;
}
float Most(float a, float b) {
  return a > b ? a : b;
}

Vec3f ToFloat(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

// Up to this many radii of the object's bounding sphere away, rays start at the eye: Embree culls packets
// best when they share an origin. From farther, single precision would blur the object, and rays start on the
// near plane.
constexpr double kFarEyeRadii = 100;

// All that stays the same over one image.
struct Frame {
  RTCScene scene;
  bool packets_of_16;
  const float* vertices;  // ShadingMesh::Vertex as six floats each
  const int* corners;
  bool two_sided;
  Vec3f forward, right, up;            // direction = forward + sx * right + sy * up
  Vec3f start, start_right, start_up;  // origin = start + sx * start_right + sy * start_up
  double start_depth_m;                // of the origins: 0 or the near plane's
  float tnear, tfar;                   // the planes, seen from the origins
  std::vector<float> sx, sy;           // slopes by column and by row
  Vec3f light[kLights.size()];
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
  const double eye_distance_m = (view.eye_m - surface.bounds().Centre()).norm();
  const bool far_eye = eye_distance_m > kFarEyeRadii * 0.5 * surface.bounds().DiagonalM();
  frame.start_depth_m = far_eye ? view.near_m : 0.0;
  frame.start = ToFloat(view.eye_m + frame.start_depth_m * view.forward);
  frame.start_right = ToFloat(frame.start_depth_m * view.right);
  frame.start_up = ToFloat(frame.start_depth_m * view.up);
  frame.tnear = static_cast<float>(view.near_m - frame.start_depth_m);
  frame.tfar = static_cast<float>(view.far_m - frame.start_depth_m);
  frame.sx.resize(view.width);
  frame.sy.resize(view.height);
  for (int x = 0; x < view.width; ++x)
    frame.sx[x] = static_cast<float>((x + 0.5 - 0.5 * view.width) * view.step);
  for (int y = 0; y < view.height; ++y)
    frame.sy[y] = static_cast<float>((0.5 * view.height - y - 0.5) * view.step);
  frame.lighting = MakeLighting(view, surface.bounds(), look);
  for (size_t i = 0; i < kLights.size(); ++i) {
    const std::array<float, 3>& position_m = frame.lighting.position_m[i];
    frame.light[i] = {position_m[0], position_m[1], position_m[2]};
  }
  return frame;
}

// The rays of one tile, as Embree wants them.
struct Tile {
  alignas(64) int valid[kLanes];  // -1: lies in the image
  alignas(64) RTCRayHit16 rays;
};

// Sets what is the same for all tiles; Embree does not change it.
void StartTile(const Frame& frame, Tile* tile) {
  std::memset(tile, 0, sizeof *tile);
  for (int i = 0; i < kLanes; ++i) {
    tile->rays.ray.tnear[i] = frame.tnear;
    tile->rays.ray.mask[i] = 0xFFFFFFFFu;
    tile->rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

// Fills origins and directions. Lanes beyond the image repeat its last column and row, and are not valid.
void MakeRays(const Frame& frame, int column, int row, Tile* tile) {
  const int width = static_cast<int>(frame.sx.size()), height = static_cast<int>(frame.sy.size());
  alignas(64) float sx[kLanes], sy[kLanes];
  if (column + kTileWidth <= width && row + kTileHeight <= height) {
    for (int i = 0; i < kLanes; ++i) {
      tile->valid[i] = -1;
      sx[i] = frame.sx[column + LaneColumn(i)];
      sy[i] = frame.sy[row + LaneRow(i)];
    }
  } else {
    for (int i = 0; i < kLanes; ++i) {
      const int x = column + LaneColumn(i), y = row + LaneRow(i);
      tile->valid[i] = x < width && y < height ? -1 : 0;
      sx[i] = frame.sx[std::min(x, width - 1)];
      sy[i] = frame.sy[std::min(y, height - 1)];
    }
  }
  RTCRay16& ray = tile->rays.ray;
  for (int i = 0; i < kLanes; ++i) {
    ray.org_x[i] = frame.start.x + sx[i] * frame.start_right.x + sy[i] * frame.start_up.x;
    ray.org_y[i] = frame.start.y + sx[i] * frame.start_right.y + sy[i] * frame.start_up.y;
    ray.org_z[i] = frame.start.z + sx[i] * frame.start_right.z + sy[i] * frame.start_up.z;
    ray.dir_x[i] = frame.forward.x + sx[i] * frame.right.x + sy[i] * frame.up.x;
    ray.dir_y[i] = frame.forward.y + sx[i] * frame.right.y + sy[i] * frame.up.y;
    ray.dir_z[i] = frame.forward.z + sx[i] * frame.right.z + sy[i] * frame.up.z;
    ray.tfar[i] = frame.tfar;
    tile->rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
}

// For processors without 512-bit vectors: the tile's two halves.
void CastHalves(const Frame& frame, RTCIntersectContext* context, Tile* tile) {
  const auto half_of = [](const auto& lanes, int first, auto* half) {
    std::memcpy(half, lanes + first, 8 * sizeof lanes[0]);
  };
  for (int first = 0; first < kLanes; first += 8) {
    alignas(32) RTCRayHit8 half;
    const RTCRay16& ray = tile->rays.ray;
    half_of(ray.org_x, first, half.ray.org_x);
    half_of(ray.org_y, first, half.ray.org_y);
    half_of(ray.org_z, first, half.ray.org_z);
    half_of(ray.dir_x, first, half.ray.dir_x);
    half_of(ray.dir_y, first, half.ray.dir_y);
    half_of(ray.dir_z, first, half.ray.dir_z);
    half_of(ray.tnear, first, half.ray.tnear);
    half_of(ray.tfar, first, half.ray.tfar);
    half_of(ray.time, first, half.ray.time);
    half_of(ray.mask, first, half.ray.mask);
    half_of(ray.id, first, half.ray.id);
    half_of(ray.flags, first, half.ray.flags);
    half_of(tile->rays.hit.geomID, first, half.hit.geomID);
    half_of(tile->rays.hit.instID[0], first, half.hit.instID[0]);
    rtcIntersect8(tile->valid + first, frame.scene, context, &half);
    std::memcpy(tile->rays.hit.geomID + first, half.hit.geomID, sizeof half.hit.geomID);
    std::memcpy(tile->rays.hit.primID + first, half.hit.primID, sizeof half.hit.primID);
  }
}

// Hits that wait to be shaded, a lane a pixel. What the loops over lanes write stands before what they read.
struct Hits {
  static constexpr int kMost = 256;
  static constexpr int kRoom = kMost + kLanes;  // appending a tile never overflows
  int count = 0;
  alignas(64) int pixel[kRoom] = {};     // row * width + column
  alignas(64) int triangle[kRoom] = {};  // 3 * index
  alignas(64) float sx[kRoom] = {};      // the ray's slopes
  alignas(64) float sy[kRoom] = {};
  // Its three corners: position and normal.
  alignas(64) float corner[3][6][kRoom] = {};
  // Results.
  alignas(64) int level[kRoom] = {};    // grey
  alignas(64) float depth[kRoom] = {};  // beyond the origins
};

void Append(const Frame& frame, const Tile& tile, int column, int row, Hits* hits) {
  const int width = static_cast<int>(frame.sx.size());
  int count = hits->count;
  for (int i = 0; i < kLanes; ++i) {
    // Always written, counted only if hit: no branch to mispredict.
    const int x = column + LaneColumn(i), y = row + LaneRow(i);
    hits->pixel[count] = y * width + x;
    hits->triangle[count] = static_cast<int>(3 * tile.rays.hit.primID[i]);
    count += tile.rays.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
  }
  hits->count = count;
}

// Fetches corners, so that the loops below read memory in order.
void Gather(const Frame& frame, Hits* hits) {
  const int width = static_cast<int>(frame.sx.size());
  for (int i = 0; i < hits->count; ++i) {
    hits->sx[i] = frame.sx[hits->pixel[i] % width];
    hits->sy[i] = frame.sy[hits->pixel[i] / width];
    for (int place = 0; place < 3; ++place) {
      const float* const vertex = frame.vertices + 6 * frame.corners[hits->triangle[i] + place];
      for (int k = 0; k < 6; ++k) hits->corner[place][k][i] = vertex[k];
    }
  }
}

// Grey levels and depths.
void Shade(const Frame& frame, Hits* hits) {
  static_assert(kLights.size() == 2, "the lights are spelt out for the compiler's vectoriser");
  const Vec3f forward = frame.forward, right = frame.right, up = frame.up;
  const Vec3f start = frame.start, start_right = frame.start_right, start_up = frame.start_up;
  const float side_of_back = frame.two_sided ? -1.0f : 1.0f;
  const Vec3f key = frame.light[0], fill = frame.light[1];
  const float scale = frame.lighting.scale;
  const auto& a = hits->corner[0];
  const auto& b = hits->corner[1];
  const auto& c = hits->corner[2];

  // Whole vectors: the lanes after the last hit hold old values, and nobody looks at theirs.
  const int lanes = (hits->count + 7) / 8 * 8;
#pragma GCC ivdep
  for (int i = 0; i < lanes; ++i) {
    const float ax = a[0][i], ay = a[1][i], az = a[2][i];
    const float e1x = b[0][i] - ax, e1y = b[1][i] - ay, e1z = b[2][i] - az;
    const float e2x = c[0][i] - ax, e2y = c[1][i] - ay, e2z = c[2][i] - az;
    const float slope_x = hits->sx[i], slope_y = hits->sy[i];
    const float dx = forward.x + slope_x * right.x + slope_y * up.x;
    const float dy = forward.y + slope_x * right.y + slope_y * up.y;
    const float dz = forward.z + slope_x * right.z + slope_y * up.z;
    const float ox = start.x + slope_x * start_right.x + slope_y * start_up.x;
    const float oy = start.y + slope_x * start_right.y + slope_y * start_up.y;
    const float oz = start.z + slope_x * start_right.z + slope_y * start_up.z;

    // Where the ray meets the triangle's plane (Moeller and Trumbore 1997), kept inside the triangle.
    const float px = dy * e2z - dz * e2y, py = dz * e2x - dx * e2z, pz = dx * e2y - dy * e2x;
    const float determinant = e1x * px + e1y * py + e1z * pz;
    const float inverse = 1.0f / (determinant == 0.0f ? 1e-30f : determinant);
    const float sx = ox - ax, sy = oy - ay, sz = oz - az;
    const float qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
    const float free_u = (sx * px + sy * py + sz * pz) * inverse;
    const float free_v = (dx * qx + dy * qy + dz * qz) * inverse;
    const float u = Least(Most(free_u, 0.0f), 1.0f);
    const float v = Least(Most(free_v, 0.0f), 1.0f - u);
    const float w = 1.0f - u - v;

    // Interpolated point and normal, turned with the face towards the viewer.
    const float side = determinant < 0.0f ? side_of_back : 1.0f;
    const float nx = side * (w * a[3][i] + u * b[3][i] + v * c[3][i]);
    const float ny = side * (w * a[4][i] + u * b[4][i] + v * c[4][i]);
    const float nz = side * (w * a[5][i] + u * b[5][i] + v * c[5][i]);
    const float x = ax + u * e1x + v * e2x, y = ay + u * e1y + v * e2y, z = az + u * e1z + v * e2z;
    const float nn = nx * nx + ny * ny + nz * nz;

    // Two point lights.
    const float kx = key.x - x, ky = key.y - y, kz = key.z - z;
    const float fx = fill.x - x, fy = fill.y - y, fz = fill.z - z;
    const float key_cosine =
        Most(nx * kx + ny * ky + nz * kz, 0.0f) / std::sqrt(nn * (kx * kx + ky * ky + kz * kz) + 1e-30f);
    const float fill_cosine =
        Most(nx * fx + ny * fy + nz * fz, 0.0f) / std::sqrt(nn * (fx * fx + fy * fy + fz * fz) + 1e-30f);
    const float shade = kAmbient + kLights[0].strength * key_cosine + kLights[1].strength * fill_cosine;
    hits->level[i] = static_cast<int>(Least(shade, 1.0f) * scale * 255.0f + 0.5f);

    // Depth of that point beyond the origin: how far it lies along the ray.
    hits->depth[i] = ((x - ox) * dx + (y - oy) * dy + (z - oz) * dz) / (dx * dx + dy * dy + dz * dz);
  }
}

// Copies results into the image and starts anew.
void Store(const Frame& frame, Hits* hits, Image* image) {
  const float start_depth_m = static_cast<float>(frame.start_depth_m);
  if (image->channels == 1) {
    for (int i = 0; i < hits->count; ++i)
      image->pixels[hits->pixel[i]] = static_cast<uint8_t>(hits->level[i]);
  } else {
    for (int i = 0; i < hits->count; ++i)
      std::memset(&image->pixels[3 * static_cast<size_t>(hits->pixel[i])], hits->level[i], 3);
  }
  if (!image->depth_m.empty())
    for (int i = 0; i < hits->count; ++i) image->depth_m[hits->pixel[i]] = start_depth_m + hits->depth[i];
  if (!image->mask.empty())
    for (int i = 0; i < hits->count; ++i) image->mask[hits->pixel[i]] = 255;
  hits->count = 0;
}

void ShadeAll(const Frame& frame, Hits* hits, Image* image) {
  Gather(frame, hits);
  Shade(frame, hits);
  Store(frame, hits, image);
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
    StartTile(frame, &tile);
    const std::unique_ptr<Hits> hits = std::make_unique<Hits>();
    const int first_row = box.first_row / kTileHeight * kTileHeight;
    const int first_column = box.first_column / kTileWidth * kTileWidth;
    for (int row = first_row; row < box.last_row; row += kTileHeight) {
      for (int column = first_column; column < box.last_column; column += kTileWidth) {
        MakeRays(frame, column, row, &tile);
        if (frame.packets_of_16) {
          rtcIntersect16(tile.valid, frame.scene, &context, &tile.rays);
        } else {
          CastHalves(frame, &context, &tile);
        }
        Append(frame, tile, column, row, hits.get());
        if (hits->count >= Hits::kMost) ShadeAll(frame, hits.get(), &image);
      }
    }
    ShadeAll(frame, hits.get(), &image);
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
