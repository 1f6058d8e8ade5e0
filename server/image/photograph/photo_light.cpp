#include "server/image/photograph/photo_light.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <embree3/rtcore.h>

#include "server/image/photograph/photo_power.h"
#include "server/image/photograph/photo_rays.h"
#include "server/image/scene/shading.h"

namespace touchstone::image {
namespace {

// Shadow rays start this far above the flat triangle, in the larger of the bounding sphere's radius and the farthest
// coordinate: above its neighbours, which the search for triangles holds larger by their rounding, and so near that
// borders of shadows keep their place. A displaced border reads as a displaced lamp: at 1e-4 by 0.4 mm.
constexpr double kShadowOffset = 1.5e-6;

float ShadowOffsetM(const geometry::Bounds& bounds) {
  const double farthest_m = std::max(bounds.min_m.cwiseAbs().maxCoeff(), bounds.max_m.cwiseAbs().maxCoeff());
  return static_cast<float>(kShadowOffset * std::max(0.5 * bounds.DiagonalM(), farthest_m));
}

}  // namespace

LampPlaces PlaceLamps(const Camera& commanded, const geometry::Bounds& bounds,
                      const effects::PhotoSettings& settings, const SurfacePlace& place) {
  const View view = MakeView(commanded, bounds, ImageOptions());
  const double radius_m = 0.5 * bounds.DiagonalM();
  const auto position = [&](const LightPlace& lamp, const Eigen::Vector3d& offset_m) {
    const Eigen::Vector3d along =
        radius_m * Eigen::Vector3d(lamp.right, lamp.up, lamp.towards_eye) + offset_m;
    return place.ToMesh(bounds.Centre() + along.x() * view.right + along.y() * view.up -
                        along.z() * view.forward);
  };
  return {position(kLights[0], settings.key_light_offset_m), position(kLights[1], Eigen::Vector3d::Zero())};
}

void FindLamps(const PhotoPoints& points, const LampPlaces& lamps, PhotoLamps* result) {
  const size_t room = points.depth_m.size();
  result->key_cosine.resize(room);
  result->fill_cosine.resize(room);
  result->half_cosine.resize(room);
  result->in_shadow.clear();
  const Eigen::Vector3f key = lamps.key_m.cast<float>(), fill = lamps.fill_m.cast<float>();
  const float key_x = key.x(), key_y = key.y(), key_z = key.z();
  const float fill_x = fill.x(), fill_y = fill.y(), fill_z = fill.z();
  const float* const px = points.point_m[0].data();
  const float* const py = points.point_m[1].data();
  const float* const pz = points.point_m[2].data();
  const float* const nx = points.normal[0].data();
  const float* const ny = points.normal[1].data();
  const float* const nz = points.normal[2].data();
  const float* const vx = points.to_eye[0].data();
  const float* const vy = points.to_eye[1].data();
  const float* const vz = points.to_eye[2].data();
  float* const key_cosine = result->key_cosine.data();
  float* const fill_cosine = result->fill_cosine.data();
  float* const half_cosine = result->half_cosine.data();
#pragma GCC ivdep
  for (int i = 0; i < points.count; ++i) {
    const float kx = key_x - px[i], ky = key_y - py[i], kz = key_z - pz[i];
    const float fx = fill_x - px[i], fy = fill_y - py[i], fz = fill_z - pz[i];
    const float k = 1.0f / std::sqrt(kx * kx + ky * ky + kz * kz + 1e-30f);
    const float f = 1.0f / std::sqrt(fx * fx + fy * fy + fz * fz + 1e-30f);
    const float nk = (nx[i] * kx + ny[i] * ky + nz[i] * kz) * k;
    const float nf = (nx[i] * fx + ny[i] * fy + nz[i] * fz) * f;
    const float hx = kx * k + vx[i], hy = ky * k + vy[i], hz = kz * k + vz[i];
    const float nh = (nx[i] * hx + ny[i] * hy + nz[i] * hz) / std::sqrt(hx * hx + hy * hy + hz * hz + 1e-30f);
    key_cosine[i] = nk > 0.0f ? nk : 0.0f;
    fill_cosine[i] = nf > 0.0f ? nf : 0.0f;
    half_cosine[i] = nk > 0.0f && nh > 0.0f ? nh : 0.0f;
  }
}

void FindShadows(const geometry::Surface& surface, const PhotoPoints& points, const LampPlaces& lamps,
                 PhotoLamps* result) {
  const RayPackets packets(static_cast<RTCScene>(surface.embree_scene()));
  const float offset_m = ShadowOffsetM(surface.bounds());
  const Eigen::Vector3f key = lamps.key_m.cast<float>();
  result->in_shadow.assign(points.depth_m.size(), 0);
  alignas(64) int valid[16];
  alignas(64) RTCRay16 rays;
  std::memset(&rays, 0, sizeof rays);
  int lane_point[16];
  int lanes = 0;
  const auto cast = [&] {
    for (int i = 0; i < 16; ++i) valid[i] = i < lanes ? -1 : 0;
    packets.Occluded(valid, &rays);
    for (int i = 0; i < lanes; ++i) result->in_shadow[lane_point[i]] = rays.tfar[i] < 0.0f;
    lanes = 0;
  };
  for (int i = 0; i < points.count; ++i) {
    if (!(result->key_cosine[i] > 0.0f)) continue;  // has no key light to lose
    const Eigen::Vector3f point(points.point_m[0][i], points.point_m[1][i], points.point_m[2][i]);
    const Eigen::Vector3f face(points.face[0][i], points.face[1][i], points.face[2][i]);
    // Interpolated normals see the lamp where a flat triangle beside the border of the light does not. A ray from above
    // such a triangle would slip over its edge.
    if (face.dot(key - point) <= 0.0f) {
      result->in_shadow[i] = 1;
      continue;
    }
    const Eigen::Vector3f start = point + offset_m * face;
    const float x = start.x(), y = start.y(), z = start.z();
    rays.org_x[lanes] = x, rays.org_y[lanes] = y, rays.org_z[lanes] = z;
    rays.dir_x[lanes] = key.x() - x, rays.dir_y[lanes] = key.y() - y, rays.dir_z[lanes] = key.z() - z;
    rays.tnear[lanes] = 0.0f;
    rays.tfar[lanes] = 1.0f;  // up to the light
    rays.mask[lanes] = 0xFFFFFFFFu;
    rays.id[lanes] = points.triangle[i];  // which it does not meet
    lane_point[lanes++] = i;
    if (lanes == 16) cast();
  }
  if (lanes > 0) cast();
}

void FillLight(const PhotoPoints& points, const PhotoLamps& lamps, const effects::PhotoSettings& settings,
               std::vector<float>* light) {
  light->resize(points.depth_m.size());
  const float ambient = static_cast<float>(kAmbient + settings.ambient);
  const float* const key_cosine = lamps.key_cosine.data();
  const float* const fill_cosine = lamps.fill_cosine.data();
  float* const result = light->data();
  const bool shadows = settings.shadow_strength > 0;
  const bool shines = settings.specular_strength != 0;
  if (!shadows && !shines) {
    for (int i = 0; i < points.count; ++i)
      result[i] = ambient + kLights[0].strength * key_cosine[i] + kLights[1].strength * fill_cosine[i];
    return;
  }
  const float lost = static_cast<float>(settings.shadow_strength);
  const float strength = static_cast<float>(settings.specular_strength);
  const float exponent = static_cast<float>(settings.specular_exponent);
  const float* const half_cosine = lamps.half_cosine.data();
  for (int i = 0; i < points.count; ++i) {
    const float highlight = shines ? strength * PowerOf(half_cosine[i], exponent) : 0.0f;
    result[i] = kLights[0].strength * key_cosine[i] + highlight;
  }
  if (shadows) {
    const uint8_t* const in_shadow = lamps.in_shadow.data();
    for (int i = 0; i < points.count; ++i) result[i] *= 1.0f - lost * in_shadow[i];
  }
  for (int i = 0; i < points.count; ++i) result[i] += ambient + kLights[1].strength * fill_cosine[i];
}

}  // namespace touchstone::image
