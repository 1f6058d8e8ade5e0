// Photographs in the form of rendered pictures.
#include "server/image/photograph/photo_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/image/photograph/photo_test_scene.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

class PhotoImage : public testing::Test {
 protected:
  Image Take(const EffectLines& lines, const ImageOptions& options, PhotoNumber number = {}) {
    auto image = TakePhotograph(PhotoModel(lines), surface_, camera_, options, number, nullptr);
    if (image.ok()) return *std::move(image);
    ADD_FAILURE() << image.status();
    return {};
  }
  std::shared_ptr<const geometry::Surface> surface_ = MakeSurface("letter", LetterMesh());
  Camera camera_ = CameraAt({0.12, -0.26, 0.09});
};

TEST_F(PhotoImage, HasTheRenderersArraysInEveryStyleAndFormat) {
  std::string reason;
  const auto renderer = RendererNamed("cpu", &reason);
  for (const PixelFormat format : {PixelFormat::kGrey, PixelFormat::kRgb}) {
    for (const ShadingStyle style : {ShadingStyle::kShaded, ShadingStyle::kDarkOnWhite}) {
      ImageOptions options = WithAll(80, 60);
      options.format = format, options.shading_style = style;
      const Image rendered = *renderer->Render(surface_, camera_, options);
      const Image photo = Take({}, options);
      ASSERT_EQ(photo.pixels.size(), rendered.pixels.size());
      ASSERT_EQ(photo.depth_m.size(), rendered.depth_m.size());
      ASSERT_EQ(photo.mask.size(), rendered.mask.size());
      EXPECT_EQ(photo.channels, rendered.channels);
      int other = 0;
      for (size_t i = 0; i < photo.pixels.size(); ++i)
        other += std::abs(int{photo.pixels[i]} - int{rendered.pixels[i]}) > 1;
      EXPECT_LE(other, 9);  // silhouettes through pixel centres
    }
  }
}

TEST_F(PhotoImage, IsRefusedDarkOnWhiteIfEffectsOfPhotographsAct) {
  ImageOptions options;
  options.shading_style = ShadingStyle::kDarkOnWhite;
  const auto refused =
      TakePhotograph(PhotoModel({{"exposure", {"stops=1"}}}), surface_, camera_, options, {}, nullptr);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("exposure"));
  EXPECT_FALSE(Take({{"object_pose", {"translation_mm=3,0,0"}}}, options).pixels.empty());
}

TEST_F(PhotoImage, DrawsTheNoiseOfItsNumber) {
  const EffectLines noisy = {{"image_noise", {"sigma_grey=2"}}, {"background_level", {"grey=60"}}};
  const ImageOptions options = WithAll(80, 60);
  const std::vector<uint8_t> pixels = Take(noisy, options, {3, 4}).pixels;
  EXPECT_EQ(Take(noisy, options, {3, 4}).pixels, pixels);
  EXPECT_NE(Take(noisy, options, {3, 5}).pixels, pixels);
  EXPECT_NE(Take(noisy, options, {2, 4}).pixels, pixels);
}

TEST_F(PhotoImage, ChangesWithEffectsOfPhotographsAndWithASurfaceThatMoves) {
  EXPECT_FALSE(ChangesPhotographs(*PhotoModel({})));
  EXPECT_FALSE(ChangesPhotographs(*PhotoModel({{"tip_radius", {"radius_mm=1"}}})));
  EXPECT_TRUE(ChangesPhotographs(*PhotoModel({{"object_pose", {"translation_mm=3,0,0"}}})));
  EXPECT_TRUE(ChangesPhotographs(*PhotoModel({{"gamma", {"exponent=0.5"}}})));
}

}  // namespace
}  // namespace touchstone::image
