// PNG and JPEG. The same pixels always give the same bytes.
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/image/image.h"

namespace touchstone::image {

// `channels` 1 or 3, rows from the top. Fast rather than small: libspng, compression level 1, filter SUB.
absl::StatusOr<std::string> EncodePng(const uint8_t* pixels, int width, int height, int channels);
absl::StatusOr<std::string> EncodeJpeg(const uint8_t* pixels, int width, int height, int channels,
                                       int quality);

// For tests and clients; refuses more than kMaxImageSide per side, and what is not whole (whole_picture.h).
absl::StatusOr<Image> DecodePng(const std::string& png);

// A PNG or JPEG file, whichever its first bytes say; likewise.
absl::StatusOr<Image> DecodePicture(const std::string& bytes);

struct PictureSize {
  int width = 0, height = 0, channels = 0;
  size_t bytes() const { return size_t{1} * width * height * channels; }
};
// What a PNG that DecodePlainPng takes will take in memory, from its header alone: a few hundred bytes can stand for
// twelve million.
absl::StatusOr<PictureSize> PlainPngSize(absl::string_view png);

// What was measured must not be converted on the way: a PNG of 8-bit grey or RGB as it is, whole to its last chunk.
// INVALID_ARGUMENT says what the file is otherwise (16 bits, palette, transparency, damaged).
absl::StatusOr<Image> DecodePlainPng(absl::string_view png);

}  // namespace touchstone::image
