// Photographs as a bench would take them, with the mask that is right: rendered objects on grounds with uneven light, a
// shadow that the key light casts on the plane behind the object (a shadow map from the light's place), lens blur and
// noise. For the test and the bench of Normalize.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/geometry/surface/surface.h"
#include "server/image/normalize/normalize_ground.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/shading.h"
#include "server/image/scene/view.h"

namespace touchstone::image {

struct EmulatedPlace {
  const char* name;
  double ground, albedo;  // in full light, 0 to 1
  double shadow;          // share of the light that it takes; 0: none
  double unevenness;      // of the light, over the picture
  double noise_grey;
  double blur_px;
  double max_penumbra_px;
  double ground_rgb[3], object_rgb[3];  // shares of that light that each channel gets; all 1: a grey picture
};

constexpr EmulatedPlace GreyPlace(const char* name, double ground, double albedo, double shadow,
                                  double unevenness, double noise_grey, double max_penumbra_px) {
  return {name, ground, albedo, shadow, unevenness, noise_grey, 0.5, max_penumbra_px, {1, 1, 1}, {1, 1, 1}};
}

inline constexpr EmulatedPlace kEmulatedPlaces[] = {
    GreyPlace("black ground", 0.0, 1.0, 0, 0.25, 3, 1),
    GreyPlace("dark ground, bright object", 0.08, 1.0, 0.5, 0.25, 3, 3),
    GreyPlace("bright ground, dark object", 0.75, 0.3, 0.4, 0.25, 3, 3),
    GreyPlace("bright ground, dark object, hard shadow", 0.75, 0.3, 0.4, 0.25, 3, 0.6),
    GreyPlace("bright ground, dark object, no shadow", 0.75, 0.3, 0, 0.3, 4, 1),
    GreyPlace("white ground, grey object", 0.95, 0.5, 0.3, 0.2, 2, 3),
    {"blue ground, orange object", 0.6, 0.7, 0.4, 0.25, 3, 0.5, 3, {0.35, 0.55, 1}, {1, 0.6, 0.25}},
    {"wooden ground, blue object", 0.7, 0.6, 0.4, 0.25, 3, 0.5, 3, {1, 0.75, 0.5}, {0.35, 0.5, 1}},
};

struct EmulatedPhotograph {
  Image photograph, background;
  std::vector<uint8_t> mask;
};

// The share of the key light that does not reach the plane behind the object, pixel by pixel.
inline Plane ShadowOnGround(Renderer* renderer, const std::shared_ptr<const geometry::Surface>& surface,
                            const View& view) {
  const geometry::Bounds bounds = surface->bounds();
  const double radius = 0.5 * bounds.DiagonalM();
  const LightPlace& key = kLights[0];
  Camera light;
  light.at_m = bounds.Centre();
  light.eye_m =
      bounds.Centre() + radius * (key.right * view.right + key.up * view.up - key.towards_eye * view.forward);
  light.up = view.up;
  light.vertical_fov_rad = 2 * std::asin(radius / (light.at_m - light.eye_m).norm()) * 1.05;
  ImageOptions options;
  options.width = options.height = 512;
  options.mask = true;
  const Image map = *renderer->Render(surface, light, options);
  const View from_light = MakeView(light, bounds, options);
  const double depth = view.DepthM(bounds.Centre()) + 0.8 * radius;
  Plane shadow(view.width, view.height);
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x) {
      const Eigen::Vector3d point = view.eye_m + depth * view.PixelVector(x, y);
      const Eigen::Vector2d at = from_light.Project(point);
      const int column = static_cast<int>(std::floor(at.x())), row = static_cast<int>(std::floor(at.y()));
      const bool inside = column >= 0 && row >= 0 && column < map.width && row < map.height;
      shadow.at(x, y) = inside && map.mask[static_cast<size_t>(row) * map.width + column] != 0 ? 1.0f : 0.0f;
    }
  return shadow;
}

// `channels` planes of light, 0 to 255, behind a lens and with noise.
inline Image RecordedPhotograph(const std::vector<Plane>& scene, const EmulatedPlace& place,
                                RandomStream* random) {
  Image image;
  image.width = scene[0].width, image.height = scene[0].height,
  image.channels = static_cast<int>(scene.size());
  image.pixels.resize(scene[0].values.size() * scene.size());
  for (size_t channel = 0; channel < scene.size(); ++channel) {
    const Plane blurred = Blurred(scene[channel], static_cast<float>(place.blur_px));
    for (size_t k = 0; k < blurred.values.size(); ++k)
      image.pixels[k * scene.size() + channel] = static_cast<uint8_t>(
          std::clamp(blurred.values[k] + place.noise_grey * random->Normal(), 0.0, 255.0) + 0.5);
  }
  return image;
}

inline EmulatedPhotograph EmulatePhotograph(Renderer* renderer,
                                            const std::shared_ptr<const geometry::Surface>& surface,
                                            const Camera& camera, const EmulatedPlace& place, uint64_t seed) {
  ImageOptions options;
  options.mask = true;
  const Image rendered = *renderer->Render(surface, camera, options);
  const View view = MakeView(camera, surface->bounds(), options);
  RandomStream random(seed, RandomDomain::kTest, 0);
  Plane shadow = ShadowOnGround(renderer, surface, view);
  shadow = Blurred(shadow, static_cast<float>(random.Uniform(0.3, place.max_penumbra_px)));
  const double direction = random.Uniform(0, 2 * kPi), slope = place.unevenness * random.Uniform(0.5, 1.0);
  const double falloff = 0.6 * place.unevenness * random.Uniform();
  const auto light = [&](int x, int y) {
    const double u = 2.0 * (x + 0.5) / view.width - 1, v = 2.0 * (y + 0.5) / view.height - 1;
    return 1 + slope * (u * std::cos(direction) + v * std::sin(direction)) - falloff * (u * u + v * v) / 2;
  };
  const bool grey = std::all_of(place.ground_rgb, place.ground_rgb + 3, [](double s) { return s == 1; }) &&
                    std::all_of(place.object_rgb, place.object_rgb + 3, [](double s) { return s == 1; });
  std::vector<Plane> with(grey ? 1 : 3, Plane(view.width, view.height)), without = with;
  for (size_t channel = 0; channel < with.size(); ++channel)
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x) {
        const size_t at = static_cast<size_t>(y) * view.width + x;
        const double ground = place.ground * place.ground_rgb[channel] * light(x, y);
        without[channel].values[at] = static_cast<float>(255 * ground);
        with[channel].values[at] = static_cast<float>(
            rendered.mask[at] ? place.albedo * place.object_rgb[channel] * rendered.pixels[at] * light(x, y)
                              : 255 * ground * (1 - place.shadow * shadow.values[at]));
      }
  EmulatedPhotograph emulated;
  emulated.mask = rendered.mask;
  emulated.photograph = RecordedPhotograph(with, place, &random);
  emulated.background = RecordedPhotograph(without, place, &random);
  return emulated;
}

// View `number` of `count`: directions of a spiral over the sphere, turned by `turn_rad`, from two distances.
inline Camera SpiralView(const geometry::Bounds& bounds, int number, int count, double turn_rad = 0) {
  const double z = 1 - 2 * (number + 0.5) / count, azimuth = number * 2.399963229728653 + turn_rad;
  const Eigen::Vector3d out(std::sqrt(1 - z * z) * std::cos(azimuth),
                            std::sqrt(1 - z * z) * std::sin(azimuth), z);
  const double radius = 0.5 * bounds.DiagonalM();
  Camera camera;
  camera.at_m = bounds.Centre();
  camera.eye_m = bounds.Centre() + out * radius * (number % 2 == 0 ? 3.2 : 4.2);
  camera.up = out.unitOrthogonal();
  return camera;
}

// Pixels in both of those in either; 1 if neither has any.
inline double MaskIou(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  size_t both = 0, either = 0;
  for (size_t k = 0; k < a.size(); ++k) {
    both += a[k] != 0 && b[k] != 0;
    either += a[k] != 0 || b[k] != 0;
  }
  return either == 0 ? 1 : static_cast<double>(both) / static_cast<double>(either);
}

}  // namespace touchstone::image
