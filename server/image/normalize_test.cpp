// Normalisation against emulated photographs: rendered objects on grounds with uneven light, a shadow that the key light
// casts on the plane behind the object (a shadow map from the light's place), lens blur and noise. The mask is compared
// with the rendered one. TOUCHSTONE_NORMALIZE_PICTURES=FOLDER writes the worst picture of every kind for people.
#include "server/image/normalize.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "server/base/random.h"
#include "server/base/sanitizers.h"
#include "server/geometry/mesh_file.h"
#include "server/image/encode.h"
#include "server/image/normalize_region.h"
#include "server/image/shading.h"
#include "server/image/test_scene.h"
#include "touchstone_test_paths.h"

namespace touchstone::image {
namespace {

struct Place {
  const char* name;
  double ground, albedo;  // in full light, 0 to 1
  double shadow;          // share of the light that it takes; 0: none
  double unevenness;      // of the light, over the picture
  double noise_grey;
  double blur_px;
  double max_penumbra_px;
  double min_iou;  // of the worst picture
};
// Where every face of the object differs from ground and shadow by more than the noise, 0.97. A white object on dark cloth
// has faces as dark as the cloth, and a grey one on white has faces as bright as its shadow: there less is asked, and
// what was reached is printed.
constexpr Place kPlaces[] = {
    {"black ground", 0.0, 1.0, 0, 0.25, 3, 0.5, 1, 0.97},
    {"dark ground, bright object", 0.08, 1.0, 0.5, 0.25, 3, 0.5, 3, 0.90},
    {"bright ground, dark object", 0.75, 0.3, 0.4, 0.25, 3, 0.5, 3, 0.97},
    {"bright ground, dark object, hard shadow", 0.75, 0.3, 0.4, 0.25, 3, 0.5, 0.6, 0.97},
    {"bright ground, dark object, no shadow", 0.75, 0.3, 0, 0.3, 4, 0.5, 1, 0.97},
    {"white ground, grey object", 0.95, 0.5, 0.3, 0.2, 2, 0.5, 3, 0.85},
};

// The share of the key light that reaches the plane behind the object, pixel by pixel.
Plane ShadowOnGround(Renderer* renderer, const std::shared_ptr<const geometry::Surface>& surface,
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

struct Emulated {
  Image photograph, background;
  std::vector<uint8_t> mask;
};

Emulated Photograph(Renderer* renderer, const std::shared_ptr<const geometry::Surface>& surface,
                    const Camera& camera, const Place& place, uint64_t seed) {
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
  Plane with(view.width, view.height), without(view.width, view.height);
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x) {
      const size_t at = static_cast<size_t>(y) * view.width + x;
      const double ground = place.ground * light(x, y);
      without.values[at] = static_cast<float>(255 * ground);
      with.values[at] =
          static_cast<float>(rendered.mask[at] ? place.albedo * rendered.pixels[at] * light(x, y)
                                               : 255 * ground * (1 - place.shadow * shadow.values[at]));
    }
  const auto record = [&](const Plane& scene) {
    const Plane blurred = Blurred(scene, static_cast<float>(place.blur_px));
    Image image;
    image.width = view.width, image.height = view.height, image.channels = 1;
    image.pixels.resize(scene.values.size());
    for (size_t k = 0; k < image.pixels.size(); ++k)
      image.pixels[k] = static_cast<uint8_t>(
          std::clamp(blurred.values[k] + place.noise_grey * random.Normal(), 0.0, 255.0) + 0.5);
    return image;
  };
  Emulated emulated;
  emulated.mask = rendered.mask;
  emulated.photograph = record(with);
  emulated.background = record(without);
  return emulated;
}

double Iou(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  size_t both = 0, either = 0;
  for (size_t k = 0; k < a.size(); ++k) {
    both += a[k] != 0 && b[k] != 0;
    either += a[k] != 0 || b[k] != 0;
  }
  return either == 0 ? 1 : static_cast<double>(both) / static_cast<double>(either);
}

// Photograph, normalised, mask in red where it has too much and blue where too little.
void WritePicture(const Emulated& emulated, const Image& normalized, const std::string& name) {
  const char* folder = std::getenv("TOUCHSTONE_NORMALIZE_PICTURES");
  if (folder == nullptr) return;
  const int width = emulated.photograph.width, height = emulated.photograph.height;
  std::vector<uint8_t> rgb(static_cast<size_t>(3) * width * height * 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const size_t at = static_cast<size_t>(y) * width + x;
      const auto set = [&](int part, uint8_t r, uint8_t g, uint8_t b) {
        uint8_t* pixel = &rgb[3 * (static_cast<size_t>(y) * 3 * width + part * width + x)];
        pixel[0] = r, pixel[1] = g, pixel[2] = b;
      };
      const uint8_t photo = emulated.photograph.pixels[at], normal = normalized.pixels[at];
      set(0, photo, photo, photo);
      set(1, normal, normal, normal);
      const bool truth = emulated.mask[at] != 0, found = normalized.mask[at] != 0;
      set(2,
          truth && !found ? 0
          : found         ? 255
                          : 0,
          truth && found ? 255 : 0,
          truth && !found ? 255
          : truth         ? 255
                          : 0);
    }
  std::ofstream(absl::StrCat(folder, "/", name, ".png"), std::ios::binary)
      << *EncodePng(rgb.data(), 3 * width, height, 3);
}

std::vector<std::shared_ptr<const geometry::Surface>> AllMeshes() {
  std::vector<std::shared_ptr<const geometry::Surface>> surfaces;
  for (const char* name : {"lat00", "lat05", "lat10", "lat15", "lat20"})
    surfaces.push_back(MakeSurface(
        name, *geometry::ReadMeshFile(absl::StrCat(TOUCHSTONE_SOURCE_DIR, "/meshes/", name, ".off"))));
  return surfaces;
}

Camera ViewNumber(const geometry::Bounds& bounds, int number, int count) {
  // Directions of a spiral over the sphere.
  const double z = 1 - 2 * (number + 0.5) / count, azimuth = number * 2.399963229728653;
  const Eigen::Vector3d out(std::sqrt(1 - z * z) * std::cos(azimuth),
                            std::sqrt(1 - z * z) * std::sin(azimuth), z);
  const double radius = 0.5 * bounds.DiagonalM();
  Camera camera;
  camera.at_m = bounds.Centre();
  camera.eye_m = bounds.Centre() + out * radius * (number % 2 == 0 ? 3.2 : 4.2);
  camera.up = out.unitOrthogonal();
  return camera;
}

class NormalizeEverywhere : public testing::TestWithParam<Place> {};
INSTANTIATE_TEST_SUITE_P(Places, NormalizeEverywhere, testing::ValuesIn(kPlaces));

void ExpectMasks(const Place& place, bool with_background) {
  const auto renderer = *CreateCpuRenderer();
  constexpr int kViews = 16;
  constexpr double kGoodIou = 0.97;
  double worst = 1, sum = 0;
  int count = 0, low = 0;
  std::string worst_words;
  Emulated worst_picture;
  Image worst_result;
  for (const auto& surface : AllMeshes())
    for (int view = 0; view < kViews; view += kUnderSanitizers ? 12 : 1) {
      Emulated emulated =
          Photograph(renderer.get(), surface, ViewNumber(surface->bounds(), view, kViews), place, view);
      auto normalized = Normalize(emulated.photograph, with_background ? &emulated.background : nullptr);
      ASSERT_TRUE(normalized.ok()) << normalized.status();
      const double iou = Iou(normalized->mask, emulated.mask);
      sum += iou;
      ++count;
      low += iou < kGoodIou;
      if (iou >= worst) continue;
      worst = iou;
      worst_words = absl::StrCat(surface->name(), ", view ", view);
      worst_picture = std::move(emulated);
      worst_result = *std::move(normalized);
    }
  WritePicture(worst_picture, worst_result, absl::StrCat(place.name, with_background ? " background" : ""));
  std::printf("%-40s %s IoU mean %.4f worst %.4f (%s), %d of %d below %.2f\n", place.name,
              with_background ? "with background" : "alone          ", sum / count, worst,
              worst_words.c_str(), low, count, kGoodIou);
  EXPECT_GE(worst, place.min_iou) << worst_words;
}

TEST_P(NormalizeEverywhere, FindsTheObjectAndNotItsShadow) {
  ExpectMasks(GetParam(), false);
}

TEST_P(NormalizeEverywhere, FindsItAgainstTheEmptyPlace) {
  ExpectMasks(GetParam(), true);
}

Image Rendered(ShadingStyle style) {
  ImageOptions options;
  options.shading_style = style;
  options.mask = true;
  const auto surface = AllMeshes()[4];
  return *(*CreateCpuRenderer())->Render(surface, ViewNumber(surface->bounds(), 3, 16), options);
}

TEST(Normalize, AShadedPictureBecomesWhatTheRendererDrawsDarkOnWhite) {
  const Image shaded = Rendered(ShadingStyle::kShaded), dark = Rendered(ShadingStyle::kDarkOnWhite);
  const auto normalized = Normalize(shaded);
  ASSERT_TRUE(normalized.ok()) << normalized.status();
  EXPECT_EQ(normalized->channels, 1);
  EXPECT_GE(Iou(normalized->mask, shaded.mask), 0.99);
  double sum = 0;
  for (size_t k = 0; k < dark.pixels.size(); ++k) sum += std::abs(normalized->pixels[k] - dark.pixels[k]);
  EXPECT_LT(sum / static_cast<double>(dark.pixels.size()), 6);
  for (size_t k = 0; k < dark.pixels.size(); ++k)
    EXPECT_EQ(normalized->mask[k] == 0, normalized->pixels[k] == 255) << k;
}

TEST(Normalize, ColourOfTheSameGreyChangesNothing) {
  const Image grey = Rendered(ShadingStyle::kShaded);
  Image rgb = grey;
  rgb.channels = 3;
  rgb.pixels.resize(3 * grey.pixels.size());
  for (size_t k = 0; k < rgb.pixels.size(); ++k) rgb.pixels[k] = grey.pixels[k / 3];
  EXPECT_EQ(Normalize(rgb)->pixels, Normalize(grey)->pixels);
}

TEST(Normalize, APictureOfNothingIsWhite) {
  Image empty = Rendered(ShadingStyle::kShaded);
  RandomStream random(1, RandomDomain::kTest, 0);
  for (const int level : {0, 90, 240}) {
    for (uint8_t& pixel : empty.pixels)
      pixel = static_cast<uint8_t>(std::clamp(level + 3 * random.Normal(), 0.0, 255.0));
    const auto normalized = Normalize(empty);
    ASSERT_TRUE(normalized.ok());
    EXPECT_FALSE(FoundObject(*normalized)) << level;
    EXPECT_EQ(*std::min_element(normalized->pixels.begin(), normalized->pixels.end()), 255) << level;
  }
}

TEST(Normalize, WhatIsNoPictureIsRefused) {
  Image picture = Rendered(ShadingStyle::kShaded);
  Image other = picture;
  other.width = 112, other.height = 448;
  EXPECT_THAT(std::string(Normalize(picture, &other).status().message()),
              testing::HasSubstr("is 112 x 448 pixels"));
  other = picture;
  other.pixels.pop_back();
  EXPECT_FALSE(Normalize(other).ok());
  other = picture;
  other.width = 8, other.height = 8, other.pixels.resize(64);
  EXPECT_THAT(std::string(Normalize(other).status().message()), testing::HasSubstr("from 16"));
  EXPECT_FALSE(Normalize(Image()).ok());
}

}  // namespace
}  // namespace touchstone::image
