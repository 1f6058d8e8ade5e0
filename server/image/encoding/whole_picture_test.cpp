#include "server/image/encoding/whole_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/image/encoding/encode.h"

namespace touchstone::image {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 64, kHeight = 48;

std::vector<uint8_t> Noise(int channels) {
  RandomStream random(1, RandomDomain::kTest);
  std::vector<uint8_t> pixels(size_t{kWidth} * kHeight * channels);
  for (uint8_t& pixel : pixels) pixel = static_cast<uint8_t>(random.Below(256));
  return pixels;
}

std::string Jpeg(int channels) {
  return *EncodeJpeg(Noise(channels).data(), kWidth, kHeight, channels, 90);
}
std::string Png() {
  return *EncodePng(Noise(3).data(), kWidth, kHeight, 3);
}
std::string Message(const std::string& bytes) {
  return std::string(CheckWholePicture(bytes).message());
}

TEST(WholePicture, TakesWholeOnesAndThoseWithMoreBehindTheEndOfAJpeg) {
  for (const int channels : {1, 3}) EXPECT_TRUE(CheckWholePicture(Jpeg(channels)).ok());
  EXPECT_TRUE(CheckWholePicture(Png()).ok());
  // As cameras fill their buffers up.
  EXPECT_TRUE(CheckWholePicture(Jpeg(3) + std::string(100, '\0')).ok());
}

// OpenCV takes what lacks its end, and fills the rest with grey (opencv issues 9477, 23311).
TEST(WholePicture, RefusesEveryCutOfAJpegAndOfAPng) {
  for (const std::string& whole : {Jpeg(1), Jpeg(3), Png()})
    for (size_t size = 0; size < whole.size(); ++size)
      ASSERT_FALSE(CheckWholePicture(whole.substr(0, size)).ok()) << size << " of " << whole.size();
  EXPECT_THAT(Message(Jpeg(3).substr(0, 2000)), HasSubstr("no end marker (EOI) after 2000 bytes"));
  EXPECT_THAT(Message(Png().substr(0, 2000)), HasSubstr("IEND"));
}

TEST(WholePicture, RefusesACutJpegThatGotAnEndAllTheSame) {
  const std::string whole = Jpeg(3);
  for (const double part : {0.3, 0.6, 0.9, 0.99}) {
    std::string cut = whole.substr(0, static_cast<size_t>(part * whole.size()));
    if (cut.back() == '\xFF') cut.pop_back();
    const std::string message = Message(cut + "\xFF\xD9");
    EXPECT_THAT(message, HasSubstr("the picture is damaged")) << part;
  }
}

TEST(WholePicture, OfWhichPartIsMissingInTheMiddleIsRefused) {
  std::string hole = Jpeg(3);
  hole.erase(hole.size() / 2, 400);
  EXPECT_THAT(Message(hole), HasSubstr("damaged"));
}

TEST(WholePicture, OfOtherFormatsNeedsEveryByteOfItsPixels) {
  const std::string pixels(6, 'x');
  const std::string ppm = "P6\n# a comment\n2 1\n255\n" + pixels;
  EXPECT_TRUE(CheckWholePicture(ppm).ok()) << Message(ppm);
  EXPECT_THAT(Message(ppm.substr(0, ppm.size() - 1)), HasSubstr("PNM: pixels are missing"));
  // 2 x 1 pixels of 24 bits: a row of 6 bytes is filled up to 8.
  std::string bmp("BM\x3e\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\2\0\0\0\1\0\0\0\1\0\x18\0", 30);
  bmp += std::string(24, '\0') + pixels + "..";
  EXPECT_TRUE(CheckWholePicture(bmp).ok()) << Message(bmp);
  EXPECT_THAT(Message(bmp.substr(0, bmp.size() - 1)), HasSubstr("BMP: pixels are missing"));
  // One strip of 6 bytes at 8, the directory behind it with its offset and its size.
  std::string tiff("II*\0\x0e\0\0\0", 8);
  tiff += pixels + std::string("\2\0\x11\1\4\0\1\0\0\0\x8\0\0\0\x17\1\4\0\1\0\0\0\6\0\0\0", 26);
  EXPECT_TRUE(CheckWholePicture(tiff).ok()) << Message(tiff);
  tiff[tiff.size() - 4] = 60;
  EXPECT_THAT(Message(tiff), HasSubstr("TIFF: pixels are missing"));
  EXPECT_THAT(Message("GIF89a"), HasSubstr("PNG, JPEG, BMP, PGM, PPM or TIFF was expected"));
}

TEST(DecodePicture, RefusesWhatIsNotWhole) {
  for (const std::string& whole : {Jpeg(1), Jpeg(3), Png()}) {
    EXPECT_TRUE(DecodePicture(whole).ok());
    for (const size_t missing : {size_t{1}, size_t{2}, size_t{12}, whole.size() * 2 / 5})
      EXPECT_TRUE(absl::IsInvalidArgument(DecodePicture(whole.substr(0, whole.size() - missing)).status()))
          << missing << " bytes of " << whole.size() << " missing";
  }
}

}  // namespace
}  // namespace touchstone::image
