// Embree's packets of 16 rays, in halves where the processor has no 512-bit vectors. Part of the simulation of
// photographs only.
#pragma once

#include <cstring>

#include <embree3/rtcore.h>

namespace touchstone::image {

class RayPackets {
 public:
  explicit RayPackets(RTCScene scene) : scene_(scene) {
    const RTCDevice device = rtcGetSceneDevice(scene);
    of_16_ = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
    rtcReleaseDevice(device);
  }

  // First hits of coherent rays: geomID and primID only are set. `valid`: -1 or 0, aligned to 64.
  void Intersect(const int* valid, RTCRayHit16* rays) const {
    RTCIntersectContext context = Context(RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
    if (of_16_) return rtcIntersect16(valid, scene_, &context, rays);
    for (int first = 0; first < 16; first += 8) {
      alignas(32) RTCRayHit8 half;
      CopyHalf(rays->ray, first, &half.ray);
      std::memcpy(half.hit.geomID, rays->hit.geomID + first, sizeof half.hit.geomID);
      std::memcpy(half.hit.instID[0], rays->hit.instID[0] + first, sizeof half.hit.instID[0]);
      rtcIntersect8(valid + first, scene_, &context, &half);
      std::memcpy(rays->hit.geomID + first, half.hit.geomID, sizeof half.hit.geomID);
      std::memcpy(rays->hit.primID + first, half.hit.primID, sizeof half.hit.primID);
    }
  }

  // Sets tfar below 0 where something stands in the way. `id`: of a triangle that does not count, kNoTriangle: all do.
  void Occluded(const int* valid, RTCRay16* rays) const {
    RTCIntersectContext context = Context(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
    if (of_16_) return rtcOccluded16(valid, scene_, &context, rays);
    for (int first = 0; first < 16; first += 8) {
      alignas(32) RTCRay8 half;
      CopyHalf(*rays, first, &half);
      rtcOccluded8(valid + first, scene_, &context, &half);
      std::memcpy(rays->tfar + first, half.tfar, sizeof half.tfar);
    }
  }

 private:
  static RTCIntersectContext Context(RTCIntersectContextFlags flags) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = flags;
    return context;
  }
  static void CopyHalf(const RTCRay16& rays, int first, RTCRay8* half) {
    const auto copy = [first](const auto& lanes, auto* part) {
      std::memcpy(part, lanes + first, 8 * sizeof lanes[0]);
    };
    copy(rays.org_x, half->org_x), copy(rays.org_y, half->org_y), copy(rays.org_z, half->org_z);
    copy(rays.dir_x, half->dir_x), copy(rays.dir_y, half->dir_y), copy(rays.dir_z, half->dir_z);
    copy(rays.tnear, half->tnear), copy(rays.tfar, half->tfar), copy(rays.time, half->time);
    copy(rays.mask, half->mask), copy(rays.id, half->id), copy(rays.flags, half->flags);
  }

  RTCScene scene_;
  bool of_16_;
};

}  // namespace touchstone::image
