// Every instruction set gives the same picture, to the byte.
#include "server/image/renderers/cpu_kernels.h"

#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/image/renderers/cpu_frame.h"
#include "server/image/renderers/test_scene.h"

namespace touchstone::image {
namespace {

TEST(CpuKernels, GiveTheSameBytesOnEveryProcessor) {
  const CpuKernels* const avx512 = Avx512Kernels();
  if (avx512 == nullptr) GTEST_SKIP() << "this processor has no AVX-512: there is one kind of kernels only";
  EXPECT_EQ(&BestKernels(), avx512);
  const auto baseline = CreateCpuRendererOf(BaselineKernels()), best = CreateCpuRendererOf(*avx512);
  RandomStream random(5, RandomDomain::kTest);
  const std::vector<std::shared_ptr<const geometry::Surface>> surfaces = {
      MakeSurface("letter", LetterMesh()), MakeSurface("fine ball", BallMesh(0.07, 100, 100)),
      MakeSurface("coarse ball", BallMesh(0.07, 10, 12)), MakeSurface("bowl", BowlMesh())};
  int64_t object_pixels = 0;
  for (int view = 0; view < 60; ++view) {
    SCOPED_TRACE(view);
    ImageOptions options;
    options.width = 1 + static_cast<int>(random.Below(230));
    options.height = 1 + static_cast<int>(random.Below(230));
    options.format = view % 3 == 0 ? PixelFormat::kRgb : PixelFormat::kGrey;
    options.shading_style = view % 2 == 0 ? ShadingStyle::kShaded : ShadingStyle::kDarkOnWhite;
    options.depth = options.mask = true;
    const Camera camera =
        CameraAt({random.Uniform(0.08, 0.3), random.Uniform(-0.2, 0.2), random.Uniform(-0.2, 0.2)});
    const auto& surface = surfaces[view % surfaces.size()];
    const Image one = *baseline->Render(surface, camera, options),
                other = *best->Render(surface, camera, options);
    EXPECT_EQ(one.pixels, other.pixels);
    EXPECT_EQ(one.depth_m, other.depth_m);
    EXPECT_EQ(one.mask, other.mask);
    for (const uint8_t level : one.mask) object_pixels += level != 0;
  }
  EXPECT_GT(object_pixels, 10'000);
}

}  // namespace
}  // namespace touchstone::image
