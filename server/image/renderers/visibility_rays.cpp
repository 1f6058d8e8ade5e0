// Primary rays through pixel centres in tiles of 4 x 4, cast by Embree as packets.
#include <algorithm>
#include <cstring>

#include <embree3/rtcore.h>

#include "server/image/renderers/cpu_frame.h"

namespace touchstone::image {
namespace {

constexpr int kTileSide = 4;
constexpr int kLanes = kTileSide * kTileSide;

// The rays of one tile, row by row, as Embree wants them.
struct Tile {
  alignas(64) int valid[kLanes];  // -1: lies in the box
  alignas(64) RTCRayHit16 rays;
};

// Sets what is the same for all tiles; Embree does not change it.
void StartTile(const CpuFrame& frame, Tile* tile) {
  std::memset(tile, 0, sizeof *tile);
  for (int i = 0; i < kLanes; ++i) {
    tile->rays.ray.tnear[i] = static_cast<float>(frame.view.near_m - frame.start_depth_m);
    tile->rays.ray.mask[i] = 0xFFFFFFFFu;
    tile->rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

// Fills origins and directions. Lanes beyond the box repeat its last column and row, and are not valid.
void MakeRays(const CpuFrame& frame, int column, int row, float tfar, Tile* tile) {
  const PixelBox& box = frame.box;
  alignas(64) float sx[kLanes], sy[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const int x = column + i % kTileSide, y = row + i / kTileSide;
    tile->valid[i] = x < box.last_column && y < box.last_row ? -1 : 0;
    sx[i] = frame.sx[std::min(x, box.last_column - 1)];
    sy[i] = frame.sy[std::min(y, box.last_row - 1)];
  }
  RTCRay16& ray = tile->rays.ray;
  for (int i = 0; i < kLanes; ++i) {
    ray.org_x[i] = frame.start.x + sx[i] * frame.start_right.x + sy[i] * frame.start_up.x;
    ray.org_y[i] = frame.start.y + sx[i] * frame.start_right.y + sy[i] * frame.start_up.y;
    ray.org_z[i] = frame.start.z + sx[i] * frame.start_right.z + sy[i] * frame.start_up.z;
    ray.dir_x[i] = frame.forward.x + sx[i] * frame.right.x + sy[i] * frame.up.x;
    ray.dir_y[i] = frame.forward.y + sx[i] * frame.right.y + sy[i] * frame.up.y;
    ray.dir_z[i] = frame.forward.z + sx[i] * frame.right.z + sy[i] * frame.up.z;
    ray.tfar[i] = tfar;
    tile->rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
}

// For processors without 512-bit vectors: the tile's two halves.
void CastHalves(RTCScene scene, RTCIntersectContext* context, Tile* tile) {
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
    rtcIntersect8(tile->valid + first, scene, context, &half);
    std::memcpy(tile->rays.hit.geomID + first, half.hit.geomID, sizeof half.hit.geomID);
    std::memcpy(tile->rays.hit.primID + first, half.hit.primID, sizeof half.hit.primID);
  }
}

bool PacketsOf16(RTCScene scene) {
  const RTCDevice device = rtcGetSceneDevice(scene);
  const bool native = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  rtcReleaseDevice(device);
  return native;
}

}  // namespace

void CastPixels(const CpuFrame& frame, Visibility* visibility) {
  const RTCScene scene = static_cast<RTCScene>(frame.surface->embree_scene());
  const bool packets_of_16 = PacketsOf16(scene);
  const float tfar = static_cast<float>(frame.view.far_m - frame.start_depth_m);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;

  Tile tile;
  StartTile(frame, &tile);
  for (int row = frame.box.first_row; row < frame.box.last_row; row += kTileSide) {
    for (int column = frame.box.first_column; column < frame.box.last_column; column += kTileSide) {
      MakeRays(frame, column, row, tfar, &tile);
      if (packets_of_16) {
        rtcIntersect16(tile.valid, scene, &context, &tile.rays);
      } else {
        CastHalves(scene, &context, &tile);
      }
      for (int i = 0; i < kLanes; ++i) {
        if (tile.rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
        visibility->Row(row + i / kTileSide)[column + i % kTileSide - frame.box.first_column] =
            tile.rays.hit.primID[i];
      }
    }
  }
}

}  // namespace touchstone::image
