// Renderers against each other, the choice between them, and the devices behind them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/image/renderers/test_scene.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

TEST(Renderers, AgreeWithinOneLevel) {
  std::string reason;
  const std::shared_ptr<Renderer> cpu = RendererNamed("cpu", &reason);
  const std::shared_ptr<Renderer> egl = RendererNamed("egl", &reason);
  if (egl == nullptr) GTEST_SKIP() << "no egl renderer here: " << reason;
  std::vector<Scene> scenes = Scenes();
  scenes.push_back({"fine ball", BallMesh(0.07, 100, 100), CameraAt({0.2, 0.1, 0.1})});
  size_t pixels = 0, beyond = 0, off_edge = 0;
  for (const ShadingStyle style : {ShadingStyle::kShaded, ShadingStyle::kDarkOnWhite}) {
    for (const Scene& scene : scenes) {
      SCOPED_TRACE(scene.name);
      const auto surface = MakeSurface(scene.name, scene.mesh);
      ImageOptions options = WithAll(224, 224);
      options.shading_style = style;
      const auto a = cpu->Render(surface, scene.camera, options),
                 b = egl->Render(surface, scene.camera, options);
      ASSERT_TRUE(a.ok() && b.ok());
      const View view = MakeView(scene.camera, surface->bounds(), options);
      for (int i = 0; i < 224 * 224; ++i) {
        ++pixels;
        if (std::abs(a->pixels[i] - b->pixels[i]) <= 1) continue;
        ++beyond;
        // Every such pixel must lie on a silhouette or an edge.
        off_edge += IsSteady(surface->mesh(), view, i % 224 + 0.5, i / 224 + 0.5, 0.02, true);
      }
    }
  }
  RecordProperty("share_beyond_one_level", std::to_string(double(beyond) / pixels));
  EXPECT_EQ(off_edge, 0u);
  EXPECT_LT(beyond, pixels / 1000);
}

TEST(Renderers, AutoDrawsAndSaysWhy) {
  const auto renderer = CreateRenderer({});
  ASSERT_TRUE(renderer.ok()) << renderer.status().message();
  EXPECT_THAT((*renderer)->description(), HasSubstr("chosen"));
  EXPECT_TRUE((*renderer)->Render(MakeSurface("letter", LetterMesh()), CameraAt({0.3, 0, 0}), {}).ok());
}

TEST(Renderers, AutoFallsBackToTheCpuWithTheReason) {
  RendererOptions options;
  options.egl_device = 63;  // there is none
  const auto renderer = CreateRenderer(options);
  ASSERT_TRUE(renderer.ok()) << renderer.status().message();
  EXPECT_EQ((*renderer)->name(), "cpu");
  EXPECT_THAT((*renderer)->description(), HasSubstr("EGL is not to be had"));
}

TEST(EglDevices, AreNamedOrSayWhyTheyDoNotRender) {
  for (const EglDevice& device : ListEglDevices()) {
    EXPECT_NE(device.renders, !device.problem.empty());
    if (!device.renders) continue;
    EXPECT_FALSE(device.name.empty());
    RendererOptions options;
    options.kind = RendererKind::kEgl;
    options.egl_device = device.index;
    const auto renderer = CreateRenderer(options);
    ASSERT_TRUE(renderer.ok()) << renderer.status().message();
    EXPECT_THAT((*renderer)->description(), HasSubstr(device.name));
  }
}

TEST(EglDevices, RefusesAnIndexThatDoesNotExist) {
  const auto renderer = CreateEglRenderer(1000);
  ASSERT_FALSE(renderer.ok());
  EXPECT_FALSE(renderer.status().message().empty());
  if (renderer.status().code() != absl::StatusCode::kUnimplemented) {
    EXPECT_THAT(std::string(renderer.status().message()), HasSubstr("1000"));
  }
}

}  // namespace
}  // namespace touchstone::image
