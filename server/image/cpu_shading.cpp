// Grey levels and depths of the triangles that are seen, the model of shading.h. Pixels are collected and
// shaded together, in loops that the compiler turns into vector instructions.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "server/image/cpu_frame.h"

namespace touchstone::image {
namespace {

// By value, unlike std::min: what the vectoriser understands.
float Min(float a, float b) {
  return a < b ? a : b;
}
float Max(float a, float b) {
  return a > b ? a : b;
}

// Hits that wait to be shaded, a lane a pixel. What the loops over lanes write stands before what they read.
struct Hits {
  static constexpr int kMax = 256;
  static constexpr int kRoom = kMax + 8;  // one is written beyond the last before it is counted
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

// Fetches corners, so that the loops below read memory in order.
void Gather(const CpuFrame& frame, Hits* hits) {
  static_assert(sizeof(ShadingMesh::Vertex) == 6 * sizeof(float), "read as six floats");
  const float* const vertices = frame.mesh->vertices.front().position_m;
  const uint32_t* const corners = frame.mesh->corners.data();
  const int width = frame.view.width;
  for (int i = 0; i < hits->count; ++i) {
    hits->sx[i] = frame.sx[hits->pixel[i] % width];
    hits->sy[i] = frame.sy[hits->pixel[i] / width];
    for (int place = 0; place < 3; ++place) {
      const float* const vertex = vertices + 6 * static_cast<size_t>(corners[hits->triangle[i] + place]);
      for (int k = 0; k < 6; ++k) hits->corner[place][k][i] = vertex[k];
    }
  }
}

// Grey levels and depths.
void Shade(const CpuFrame& frame, Hits* hits) {
  static_assert(kLights.size() == 2, "the lights are spelt out for the compiler's vectoriser");
  const Vec3f forward = frame.forward, right = frame.right, up = frame.up;
  const Vec3f start = frame.start, start_right = frame.start_right, start_up = frame.start_up;
  const float side_of_back = frame.outside_only ? 1.0f : -1.0f;
  const auto light = [&frame](int i) {
    const std::array<float, 3>& position_m = frame.lighting.position_m[i];
    return Vec3f{position_m[0], position_m[1], position_m[2]};
  };
  const Vec3f key = light(0), fill = light(1);
  const float scale = frame.lighting.scale;
  const auto& a = hits->corner[0];
  const auto& b = hits->corner[1];
  const auto& c = hits->corner[2];

  // Whole vectors: the lanes after the last hit hold old values, and no one looks at theirs.
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
    const float u = Min(Max(free_u, 0.0f), 1.0f);
    const float v = Min(Max(free_v, 0.0f), 1.0f - u);
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
        Max(nx * kx + ny * ky + nz * kz, 0.0f) / std::sqrt(nn * (kx * kx + ky * ky + kz * kz) + 1e-30f);
    const float fill_cosine =
        Max(nx * fx + ny * fy + nz * fz, 0.0f) / std::sqrt(nn * (fx * fx + fy * fy + fz * fz) + 1e-30f);
    const float shade = kAmbient + kLights[0].strength * key_cosine + kLights[1].strength * fill_cosine;
    hits->level[i] = static_cast<int>(Min(shade, 1.0f) * scale * 255.0f + 0.5f);

    // Depth of that point beyond the origin: how far it lies along the ray.
    hits->depth[i] = ((x - ox) * dx + (y - oy) * dy + (z - oz) * dz) / (dx * dx + dy * dy + dz * dz);
  }
}

// Copies results into the image and starts anew.
void Store(const CpuFrame& frame, Hits* hits, Image* image) {
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

}  // namespace

void ShadeVisible(const CpuFrame& frame, Visibility& visibility, Image* image) {
  const PixelBox& box = frame.box;
  const std::unique_ptr<Hits> hits = std::make_unique<Hits>();
  const auto finish = [&] {
    Gather(frame, hits.get());
    Shade(frame, hits.get());
    Store(frame, hits.get(), image);
  };
  for (int row = box.first_row; row < box.last_row; ++row) {
    const uint32_t* const triangle = visibility.Row(row);
    const int first_pixel = row * frame.view.width + box.first_column;
    const int columns = box.last_column - box.first_column;
    for (int first = 0; first < columns; first += Hits::kMax / 2) {
      // Always written, counted only if there is a triangle: no branch to mispredict.
      int count = hits->count;
      for (int i = first; i < std::min(first + Hits::kMax / 2, columns); ++i) {
        hits->pixel[count] = first_pixel + i;
        hits->triangle[count] = static_cast<int>(3 * triangle[i]);
        count += triangle[i] != geometry::kNoTriangle;
      }
      hits->count = count;
      if (hits->count > Hits::kMax / 2) finish();
    }
  }
  finish();
}

}  // namespace touchstone::image
