#include "server/image/encoding/encode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <turbojpeg.h>

#include "server/base/numbers/random.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

// Noise over a ramp: neither all equal nor incompressible.
std::vector<uint8_t> TestPixels(int width, int height, int channels) {
  RandomStream random(1, RandomDomain::kTest);
  std::vector<uint8_t> pixels(static_cast<size_t>(width) * height * channels);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(i / 7 + random.Below(9));
  return pixels;
}

TEST(Png, ReadsBackExactly) {
  for (const auto& [width, height, channels] :
       {std::tuple(1, 1, 1), std::tuple(1, 1, 3), std::tuple(224, 224, 1), std::tuple(53, 31, 3),
        std::tuple(kMaxImageSide, 2, 1), std::tuple(3, kMaxImageSide, 3)}) {
    const std::vector<uint8_t> pixels = TestPixels(width, height, channels);
    const auto png = EncodePng(pixels.data(), width, height, channels);
    ASSERT_TRUE(png.ok()) << png.status().message();
    EXPECT_EQ(png->substr(0, 8), "\x89PNG\r\n\x1a\n");
    const auto image = DecodePng(*png);
    ASSERT_TRUE(image.ok()) << image.status().message();
    EXPECT_EQ(image->width, width);
    EXPECT_EQ(image->height, height);
    EXPECT_EQ(image->channels, channels);
    EXPECT_EQ(image->pixels, pixels);
  }
}

TEST(Png, AndJpegOfTheSamePixelsAreTheSameBytes) {
  const std::vector<uint8_t> pixels = TestPixels(224, 224, 3);
  EXPECT_EQ(*EncodePng(pixels.data(), 224, 224, 3), *EncodePng(pixels.data(), 224, 224, 3));
  EXPECT_EQ(*EncodeJpeg(pixels.data(), 224, 224, 3, 90), *EncodeJpeg(pixels.data(), 224, 224, 3, 90));
}

TEST(Jpeg, IsOneAndShrinksWithQuality) {
  const std::vector<uint8_t> pixels = TestPixels(64, 48, 1);
  const auto fine = EncodeJpeg(pixels.data(), 64, 48, 1, 95),
             coarse = EncodeJpeg(pixels.data(), 64, 48, 1, 20);
  ASSERT_TRUE(fine.ok() && coarse.ok());
  EXPECT_EQ(fine->substr(0, 3), "\xff\xd8\xff");
  EXPECT_EQ(fine->substr(fine->size() - 2), "\xff\xd9");
  EXPECT_LT(coarse->size(), fine->size());
}

TEST(Jpeg, OfInksForPrintIsRefusedInWords) {
  const std::vector<uint8_t> inks(16 * 16 * 4, 90);
  const tjhandle handle = tjInitCompress();
  unsigned char* out = nullptr;
  unsigned long size = 0;
  ASSERT_EQ(tjCompress2(handle, inks.data(), 16, 0, 16, TJPF_CMYK, &out, &size, TJSAMP_444, 90, 0), 0);
  const auto picture = DecodePicture(std::string(reinterpret_cast<const char*>(out), size));
  EXPECT_THAT(std::string(picture.status().message()), HasSubstr("CMYK"));
  tjFree(out), tjDestroy(handle);
}

TEST(Encoding, RefusesWhatIsNoImage) {
  const std::vector<uint8_t> pixels = TestPixels(4, 4, 3);
  EXPECT_THAT(std::string(EncodePng(pixels.data(), 0, 4, 1).status().message()), HasSubstr("0 x 4"));
  EXPECT_THAT(std::string(EncodePng(pixels.data(), 20000, 4, 1).status().message()), HasSubstr("1 to 2048"));
  EXPECT_THAT(std::string(EncodePng(pixels.data(), 4, 4, 2).status().message()), HasSubstr("2 channels"));
  EXPECT_THAT(std::string(EncodePng(nullptr, 4, 4, 1).status().message()), HasSubstr("no pixels"));
  EXPECT_THAT(std::string(EncodeJpeg(pixels.data(), 4, 4, 3, 0).status().message()),
              HasSubstr("quality is 0"));
  EXPECT_THAT(std::string(EncodeJpeg(pixels.data(), 4, 4, 3, 101).status().message()),
              HasSubstr("from 1 to 100"));
}

TEST(Png, TellsItsSizeByItsHeader) {
  const std::vector<uint8_t> pixels = TestPixels(64, 48, 3);
  const std::string png = *EncodePng(pixels.data(), 64, 48, 3);
  const auto size = PlainPngSize(png.substr(0, 40));  // the pixels do not matter
  ASSERT_TRUE(size.ok()) << size.status();
  EXPECT_EQ(size->width, 64);
  EXPECT_EQ(size->height, 48);
  EXPECT_EQ(size->channels, 3);
  EXPECT_EQ(size->bytes(), pixels.size());
  EXPECT_EQ(PlainPngSize("no picture").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Png, RefusesBrokenData) {
  const std::vector<uint8_t> pixels = TestPixels(64, 64, 1);
  const std::string png = *EncodePng(pixels.data(), 64, 64, 1);
  EXPECT_EQ(DecodePng("").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DecodePng("not a picture at all, by any means").status().code(),
            absl::StatusCode::kInvalidArgument);
  // Every truncation is refused, none crashes.
  for (size_t length = 0; length + 16 < png.size(); length += 37)
    EXPECT_FALSE(DecodePng(png.substr(0, length)).ok()) << length;
  // A flipped bit breaks a checksum.
  std::string flipped = png;
  flipped[png.size() / 2] ^= 4;
  EXPECT_FALSE(DecodePng(flipped).ok());
  // A header that promises 20000 columns (its checksum cannot save it).
  std::string huge = png;
  huge[18] = 0x4e;
  huge[19] = 0x20;
  EXPECT_FALSE(DecodePng(huge).ok());
}

}  // namespace
}  // namespace touchstone::image
