// What every renderer must do, run on each; a renderer that this machine cannot have is skipped with the
// reason.
#include "server/image/renderers/renderer.h"

#include <cmath>
#include <limits>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/image/renderers/test_scene.h"
#include "server/image/scene/shading.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

class RendererTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    // One renderer of each kind for the whole run: contexts are expensive.
    static std::map<std::string, std::pair<std::shared_ptr<Renderer>, std::string>> renderers;
    auto found = renderers.find(GetParam());
    if (found == renderers.end()) {
      std::string reason;
      std::shared_ptr<Renderer> renderer = RendererNamed(GetParam(), &reason);
      found = renderers.emplace(GetParam(), std::pair(renderer, reason)).first;
    }
    renderer_ = found->second.first;
    if (renderer_ == nullptr)
      GTEST_SKIP() << "no " << GetParam() << " renderer here: " << found->second.second;
  }

  Image MustRender(const std::shared_ptr<const geometry::Surface>& surface, const Camera& camera,
                   const ImageOptions& options) {
    absl::StatusOr<Image> image = renderer_->Render(surface, camera, options);
    if (!image.ok()) {
      ADD_FAILURE() << image.status().message();
      return {};
    }
    return *std::move(image);
  }

  // EGL places corners on a grid of 1/256 pixel.
  double Blur() const { return renderer_->name() == "egl" ? 0.02 : 0.001; }

  std::shared_ptr<Renderer> renderer_;
};

INSTANTIATE_TEST_SUITE_P(Both, RendererTest, testing::Values("cpu", "egl"),
                         [](const auto& info) { return std::string(info.param); });

TEST_P(RendererTest, MasksAreThoseOfExactRays) {
  for (const Scene& scene : Scenes()) {
    SCOPED_TRACE(scene.name);
    const auto surface = MakeSurface(scene.name, scene.mesh);
    const ImageOptions options = WithAll(61, 47);
    const Image image = MustRender(surface, scene.camera, options);
    ASSERT_EQ(image.mask.size(), 61u * 47);
    const View view = MakeView(scene.camera, surface->bounds(), options);
    int object = 0, wrong = 0, unsteady = 0;
    for (int y = 0; y < 47; ++y) {
      for (int x = 0; x < 61; ++x) {
        const bool seen =
            LookAtPixel(surface->mesh(), view, x + 0.5, y + 0.5).triangle != geometry::kNoTriangle;
        const uint8_t mask = image.mask[y * 61 + x];
        ASSERT_TRUE(mask == 0 || mask == 255);
        object += seen;
        if (seen == (mask == 255)) continue;
        IsSteady(surface->mesh(), view, x + 0.5, y + 0.5, Blur(), false) ? ++wrong : ++unsteady;
      }
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_LE(unsteady, 6);
    EXPECT_GT(object, 250);
  }
}

TEST_P(RendererTest, DepthsAreThoseOfExactRays) {
  for (const Scene& scene : Scenes()) {
    SCOPED_TRACE(scene.name);
    const auto surface = MakeSurface(scene.name, scene.mesh);
    const ImageOptions options = WithAll(40, 40);
    const Image image = MustRender(surface, scene.camera, options);
    const View view = MakeView(scene.camera, surface->bounds(), options);
    // 1/256 pixel of a corner, seen at a slant, in EGL.
    const double tolerance_m = renderer_->name() == "egl" ? 2e-4 : 2e-6 + 1e-6 * view.near_m;
    int compared = 0;
    double worst_m = 0;
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        const float depth_m = image.depth_m[y * 40 + x];
        EXPECT_EQ(depth_m == 0, image.mask[y * 40 + x] == 0);
        if (depth_m == 0 || !IsSteady(surface->mesh(), view, x + 0.5, y + 0.5, 0.1, true)) continue;
        const SeenPoint seen = LookAtPixel(surface->mesh(), view, x + 0.5, y + 0.5);
        if (seen.triangle == geometry::kNoTriangle) continue;  // counted by the mask's test
        worst_m = std::max(worst_m, std::abs(depth_m - seen.depth_m));
        ++compared;
      }
    }
    EXPECT_LE(worst_m, tolerance_m);
    EXPECT_GT(compared, 100);
  }
}

// The columns and rows that a mask covers.
struct Extent {
  int left = 1 << 20, right = -1, top = 1 << 20, bottom = -1;
};
Extent ExtentOf(const Image& image) {
  Extent extent;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.mask[y * image.width + x] == 0) continue;
      extent.left = std::min(extent.left, x), extent.right = std::max(extent.right, x);
      extent.top = std::min(extent.top, y), extent.bottom = std::max(extent.bottom, y);
    }
  }
  return extent;
}

TEST_P(RendererTest, UpIsUpAndNothingIsMirrored) {
  // From -y, z up: +x is to the right. A small box up and to the right.
  geometry::TriangleMesh mesh;
  AddBox({0.02, -0.01, 0.03}, {0.04, 0.01, 0.06}, &mesh);
  const auto surface = MakeSurface("box", mesh);
  Camera camera = CameraAt({0, -0.3, 0});
  Extent extent = ExtentOf(MustRender(surface, camera, WithAll(200, 200)));
  EXPECT_GT(extent.left, 100);
  EXPECT_LT(extent.bottom, 100);
  // Its near face in closed form: half the image is 0.29 tan(22.5 deg) m there.
  const double pixels_per_m = 100 / (0.29 * std::tan(kPi / 8));
  EXPECT_NEAR(extent.right + 0.5, 100 + 0.04 * pixels_per_m, 1);
  EXPECT_NEAR(extent.top + 0.5, 100 - 0.06 * pixels_per_m, 1);
  // Upside down.
  camera.up = {0, 0, -1};
  extent = ExtentOf(MustRender(surface, camera, WithAll(200, 200)));
  EXPECT_LT(extent.right, 100);
  EXPECT_GT(extent.top, 100);
}

TEST_P(RendererTest, GreyOfAFlatFaceFollowsTheDocumentedModel) {
  geometry::TriangleMesh mesh;
  AddBox({-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}, &mesh);
  const auto surface = MakeSurface("cube", mesh);
  const Camera camera = CameraAt({0, -0.4, 0});
  for (const ShadingStyle style : {ShadingStyle::kShaded, ShadingStyle::kDarkOnWhite}) {
    ImageOptions options = WithAll(101, 101);
    options.shading_style = style;
    const Image image = MustRender(surface, camera, options);
    const View view = MakeView(camera, surface->bounds(), options);
    const double radius_m = 0.05 * std::sqrt(3.0);
    for (const auto& [x, y] : {std::pair(50, 50), std::pair(35, 60), std::pair(62, 37)}) {
      const Eigen::Vector3d ray = view.PixelVector(x, y);
      const Eigen::Vector3d point = view.eye_m + 0.35 * ray;
      double shade = kAmbient;
      for (const LightPlace& light : kLights) {
        const Eigen::Vector3d to_light =
            radius_m * (light.right * view.right + light.up * view.up - light.towards_eye * view.forward) -
            point;
        shade += light.strength * std::max(0.0, -to_light.normalized().y());
      }
      const double scale = style == ShadingStyle::kShaded ? 1.0 : kDarkScale;
      EXPECT_NEAR(image.pixels[y * 101 + x], 255 * scale * std::min(1.0, shade), 0.51);
    }
    EXPECT_EQ(image.pixels[0], style == ShadingStyle::kShaded ? 0 : 255);
  }
}

TEST_P(RendererTest, DarkLookIsDarkOnWhite) {
  const auto surface = MakeSurface("letter", LetterMesh());
  ImageOptions options = WithAll(120, 90);
  options.shading_style = ShadingStyle::kDarkOnWhite;
  const Image image = MustRender(surface, CameraAt({0.12, -0.26, 0.09}), options);
  int darkest = 255, lightest = 0;
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    if (image.mask[i] == 0) {
      EXPECT_EQ(image.pixels[i], 255);
    } else {
      darkest = std::min<int>(darkest, image.pixels[i]);
      lightest = std::max<int>(lightest, image.pixels[i]);
    }
  }
  EXPECT_LT(lightest, 128);
  EXPECT_GT(lightest - darkest, 20);  // its shape can still be seen
}

TEST_P(RendererTest, RgbIsGreyThreeTimes) {
  const auto surface = MakeSurface("letter", LetterMesh());
  ImageOptions options;
  options.width = 77;
  options.height = 33;
  const Image grey = MustRender(surface, CameraAt({0.1, -0.2, 0.1}), options);
  options.format = PixelFormat::kRgb;
  const Image rgb = MustRender(surface, CameraAt({0.1, -0.2, 0.1}), options);
  EXPECT_EQ(grey.channels, 1);
  EXPECT_EQ(rgb.channels, 3);
  ASSERT_EQ(rgb.pixels.size(), 3 * grey.pixels.size());
  for (size_t i = 0; i < rgb.pixels.size(); ++i) ASSERT_EQ(rgb.pixels[i], grey.pixels[i / 3]);
  EXPECT_TRUE(rgb.depth_m.empty());
  EXPECT_TRUE(rgb.mask.empty());
}

TEST_P(RendererTest, WhatIsAskedBesidesChangesNoPixel) {
  const auto surface = MakeSurface("ball", BallMesh(0.07, 40, 60));
  ImageOptions plain;
  const Camera camera = CameraAt({0.1, -0.2, 0.1});
  EXPECT_EQ(MustRender(surface, camera, plain).pixels, MustRender(surface, camera, WithAll(224, 224)).pixels);
}

TEST_P(RendererTest, DrawsTheSmallestAndTheLargest) {
  const auto surface = MakeSurface("ball", BallMesh(0.07, 14, 20));
  const Image dot = MustRender(surface, CameraAt({0.2, 0, 0}), WithAll(1, 1));
  ASSERT_EQ(dot.pixels.size(), 1u);
  EXPECT_GT(dot.pixels[0], 0);
  EXPECT_NEAR(dot.depth_m[0], 0.13, 0.002);
  const Image large = MustRender(surface, CameraAt({0.2, 0, 0}), WithAll(kMaxImageSide, kMaxImageSide));
  ASSERT_EQ(large.pixels.size(), size_t{kMaxImageSide} * kMaxImageSide);
  const Extent extent = ExtentOf(large);
  EXPECT_NEAR(extent.left + extent.right, kMaxImageSide - 1, 2);
  EXPECT_NEAR(extent.top + extent.bottom, kMaxImageSide - 1, 2);
  // Narrow strips: no tile of the renderer's may leave the image.
  EXPECT_EQ(MustRender(surface, CameraAt({0.2, 0, 0}), WithAll(3, kMaxImageSide)).pixels.size(), 3u * 2048);
  EXPECT_EQ(MustRender(surface, CameraAt({0.2, 0, 0}), WithAll(kMaxImageSide, 5)).pixels.size(), 5u * 2048);
}

TEST_P(RendererTest, ShowsNothingBesideOrBehind) {
  const auto surface = MakeSurface("ball", BallMesh(0.05, 14, 20));
  for (const Eigen::Vector3d& at_m : {Eigen::Vector3d(0.6, 0, 0), Eigen::Vector3d(0.3, 1, 0)}) {
    Camera camera = CameraAt({0.3, 0, 0});
    camera.at_m = at_m;
    const Image image = MustRender(surface, camera, WithAll(64, 64));
    EXPECT_EQ(std::count(image.mask.begin(), image.mask.end(), 0), 64 * 64);
    EXPECT_EQ(std::count(image.pixels.begin(), image.pixels.end(), 0), 64 * 64);
  }
}

TEST_P(RendererTest, RefusesBadRequests) {
  const auto surface = MakeSurface("ball", BallMesh(0.05, 14, 20));
  ImageOptions options;
  options.width = 0;
  EXPECT_EQ(renderer_->Render(surface, CameraAt({0.3, 0, 0}), options).status().code(),
            absl::StatusCode::kInvalidArgument);
  options.width = 20000;
  EXPECT_THAT(std::string(renderer_->Render(surface, CameraAt({0.3, 0, 0}), options).status().message()),
              HasSubstr("20000"));
  EXPECT_THAT(std::string(renderer_->Render(surface, CameraAt({0, 0, 0}), {}).status().message()),
              HasSubstr("camera.at_m"));
  EXPECT_THAT(std::string(renderer_->Render(surface, CameraAt({0, 0, 0.3}), {}).status().message()),
              HasSubstr("parallel"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(std::string(renderer_->Render(surface, CameraAt({nan, 0, 0.3}), {}).status().message()),
              HasSubstr("nan"));
}

TEST_P(RendererTest, GivesTheSameBytesFromOneAndFourThreads) {
  const std::vector<std::shared_ptr<const geometry::Surface>> surfaces = {
      MakeSurface("letter", LetterMesh()), MakeSurface("ball", BallMesh(0.07, 40, 60)),
      MakeSurface("bowl", BowlMesh())};
  constexpr int kImages = 24;
  const auto draw = [&](int i) {
    ImageOptions options = WithAll(i % 4 == 0 ? 96 : 64, 64);
    options.mask = i % 2 == 0;
    return *renderer_->Render(surfaces[i % 3], CameraAt({0.3 * std::cos(i), 0.3 * std::sin(i), 0.01 * i}),
                              options);
  };
  std::vector<Image> one(kImages), four(kImages);
  for (int i = 0; i < kImages; ++i) one[i] = draw(i);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = kImages - 1 - t; i >= 0; i -= 4) four[i] = draw(i);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (int i = 0; i < kImages; ++i) {
    EXPECT_EQ(one[i].pixels, four[i].pixels) << i;
    EXPECT_EQ(one[i].depth_m, four[i].depth_m) << i;
    EXPECT_EQ(one[i].mask, four[i].mask) << i;
  }
}

TEST_P(RendererTest, SurvivesTheDeathOfSurfaces) {
  const Image before = MustRender(MakeSurface("letter", LetterMesh()), CameraAt({0.1, -0.2, 0.1}), {});
  for (int i = 0; i < 80; ++i)
    MustRender(MakeSurface("ball", BallMesh(0.05, 8, 12)), CameraAt({0.3, 0, 0}), {});
  EXPECT_EQ(MustRender(MakeSurface("letter", LetterMesh()), CameraAt({0.1, -0.2, 0.1}), {}).pixels,
            before.pixels);
}

}  // namespace
}  // namespace touchstone::image
