#include "server/image/encoding/encode.h"

#include <cstdlib>
#include <memory>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <spng.h>
#include <turbojpeg.h>

#include "server/base/status.h"
#include "server/image/encoding/whole_picture.h"

namespace touchstone::image {
namespace {

struct SpngDelete {
  void operator()(spng_ctx* context) const { spng_ctx_free(context); }
};
using SpngContext = std::unique_ptr<spng_ctx, SpngDelete>;

struct FreeDelete {
  void operator()(void* memory) const { std::free(memory); }
};

absl::Status CheckPixels(const uint8_t* pixels, int width, int height, int channels) {
  if (pixels == nullptr) return absl::InvalidArgumentError("image has no pixels");
  if (width < 1 || width > kMaxImageSide || height < 1 || height > kMaxImageSide) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "image is %d x %d pixels; each side must be from 1 to %d", width, height, kMaxImageSide));
  }
  if (channels != 1 && channels != 3) {
    return absl::InvalidArgumentError(
        absl::StrFormat("image has %d channels; must be 1 (grey) or 3 (RGB)", channels));
  }
  return absl::OkStatus();
}

absl::Status PngError(const char* action, int code) {
  return absl::InternalError(absl::StrCat("PNG: ", action, " failed: ", spng_strerror(code)));
}
absl::Status BadPng(const char* what, int code) {
  return absl::InvalidArgumentError(absl::StrCat("PNG: ", what, ": ", spng_strerror(code)));
}

// A TurboJPEG compressor keeps some hundred kilobytes of tables: one per thread, made at its first image.
tjhandle ThreadCompressor() {
  struct Compressor {
    tjhandle handle = tjInitCompress();
    ~Compressor() {
      if (handle != nullptr) tjDestroy(handle);
    }
  };
  static thread_local Compressor compressor;
  return compressor.handle;
}

tjhandle ThreadDecompressor() {
  struct Decompressor {
    tjhandle handle = tjInitDecompress();
    ~Decompressor() {
      if (handle != nullptr) tjDestroy(handle);
    }
  };
  static thread_local Decompressor decompressor;
  return decompressor.handle;
}

struct OpenPng {
  SpngContext context;
  spng_ihdr header{};
};

absl::StatusOr<OpenPng> Open(absl::string_view png) {
  OpenPng open;
  open.context.reset(spng_ctx_new(0));
  spng_ctx* context = open.context.get();
  if (context == nullptr) return absl::ResourceExhaustedError("PNG: no memory for a decoder");
  spng_set_image_limits(context, kMaxImageSide, kMaxImageSide);
  spng_set_chunk_limits(context, 1 << 20, 1 << 22);
  spng_set_crc_action(context, SPNG_CRC_ERROR, SPNG_CRC_ERROR);
  if (int code = spng_set_png_buffer(context, png.data(), png.size()); code != 0)
    return BadPng("no data", code);
  if (int code = spng_get_ihdr(context, &open.header); code != 0)
    return BadPng(absl::StrFormat("header (each side must be from 1 to %d)", kMaxImageSide).c_str(), code);
  return open;
}

absl::StatusOr<Image> Decode(const OpenPng& open, bool grey) {
  Image image;
  image.width = static_cast<int>(open.header.width);
  image.height = static_cast<int>(open.header.height);
  image.channels = grey ? 1 : 3;
  const spng_format format = grey ? SPNG_FMT_G8 : SPNG_FMT_RGB8;
  size_t bytes = 0;
  if (int code = spng_decoded_image_size(open.context.get(), format, &bytes); code != 0)
    return BadPng("size", code);
  image.pixels.resize(bytes);
  if (int code = spng_decode_image(open.context.get(), image.pixels.data(), bytes, format, 0); code != 0)
    return BadPng("pixels", code);
  return image;
}

const char* ColourWords(int color_type) {
  switch (color_type) {
    case SPNG_COLOR_TYPE_GRAYSCALE:
      return "grey";
    case SPNG_COLOR_TYPE_TRUECOLOR:
      return "RGB";
    case SPNG_COLOR_TYPE_INDEXED:
      return "with a palette";
    case SPNG_COLOR_TYPE_GRAYSCALE_ALPHA:
      return "grey with transparency";
    default:
      return "RGB with transparency";
  }
}

absl::StatusOr<PictureSize> PlainSize(const spng_ihdr& header) {
  const bool grey = header.color_type == SPNG_COLOR_TYPE_GRAYSCALE;
  if (header.bit_depth != 8 || (!grey && header.color_type != SPNG_COLOR_TYPE_TRUECOLOR))
    return absl::InvalidArgumentError(
        absl::StrFormat("PNG: is %d-bit %s; 8-bit grey or RGB without transparency was expected",
                        header.bit_depth, ColourWords(header.color_type)));
  return PictureSize{static_cast<int>(header.width), static_cast<int>(header.height), grey ? 1 : 3};
}

}  // namespace

absl::StatusOr<std::string> EncodePng(const uint8_t* pixels, int width, int height, int channels) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPixels(pixels, width, height, channels));
  SpngContext context(spng_ctx_new(SPNG_CTX_ENCODER));
  if (context == nullptr) return absl::ResourceExhaustedError("PNG: no memory for an encoder");
  spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1);
  spng_set_option(context.get(), SPNG_IMG_COMPRESSION_LEVEL, 1);
  spng_set_option(context.get(), SPNG_FILTER_CHOICE, SPNG_FILTER_CHOICE_SUB);

  spng_ihdr header{};
  header.width = static_cast<uint32_t>(width);
  header.height = static_cast<uint32_t>(height);
  header.bit_depth = 8;
  header.color_type = channels == 3 ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE;
  if (int code = spng_set_ihdr(context.get(), &header); code != 0) return PngError("header", code);
  const size_t bytes = static_cast<size_t>(width) * height * channels;
  if (int code = spng_encode_image(context.get(), pixels, bytes, SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
      code != 0)
    return PngError("encoding", code);
  size_t size = 0;
  int code = 0;
  std::unique_ptr<void, FreeDelete> buffer(spng_get_png_buffer(context.get(), &size, &code));
  if (buffer == nullptr) return PngError("encoding", code);
  return std::string(static_cast<const char*>(buffer.get()), size);
}

absl::StatusOr<std::string> EncodeJpeg(const uint8_t* pixels, int width, int height, int channels,
                                       int quality) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPixels(pixels, width, height, channels));
  if (quality < 1 || quality > 100) {
    return absl::InvalidArgumentError(absl::StrFormat("JPEG quality is %d; must be from 1 to 100", quality));
  }
  const tjhandle handle = ThreadCompressor();
  if (handle == nullptr) return absl::ResourceExhaustedError("JPEG: no memory for an encoder");

  // Colour is kept at full resolution: a dataset should not learn from chroma blocks.
  const int sampling = channels == 3 ? TJSAMP_444 : TJSAMP_GRAY;
  const int format = channels == 3 ? TJPF_RGB : TJPF_GRAY;
  std::string jpeg(tjBufSize(width, height, sampling), '\0');
  unsigned char* out = reinterpret_cast<unsigned char*>(jpeg.data());
  unsigned long size = jpeg.size();
  if (tjCompress2(handle, pixels, width, 0, height, format, &out, &size, sampling, quality,
                  TJFLAG_NOREALLOC) != 0)
    return absl::InternalError(absl::StrCat("JPEG: encoding failed: ", tjGetErrorStr2(handle)));
  jpeg.resize(size);
  return jpeg;
}

absl::StatusOr<Image> DecodePng(const std::string& png) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const OpenPng open, Open(png));
  TOUCHSTONE_RETURN_IF_ERROR(CheckWholePicture(png));
  const bool grey = open.header.color_type == SPNG_COLOR_TYPE_GRAYSCALE && open.header.bit_depth <= 8;
  return Decode(open, grey);
}

absl::StatusOr<Image> DecodePicture(const std::string& bytes) {
  if (absl::StartsWith(bytes, "\x89PNG")) return DecodePng(bytes);
  if (!absl::StartsWith(bytes, "\xFF\xD8"))
    return absl::InvalidArgumentError("is neither PNG nor JPEG; one of them was expected");
  const tjhandle handle = ThreadDecompressor();
  if (handle == nullptr) return absl::ResourceExhaustedError("JPEG: no memory for a decoder");
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  Image image;
  int sampling = 0, colours = 0;
  if (tjDecompressHeader3(handle, data, bytes.size(), &image.width, &image.height, &sampling, &colours) != 0)
    return absl::InvalidArgumentError(absl::StrCat("JPEG: header: ", tjGetErrorStr2(handle)));
  if (image.width < 1 || image.width > kMaxImageSide || image.height < 1 || image.height > kMaxImageSide)
    return absl::InvalidArgumentError(absl::StrFormat(
        "JPEG: is %d x %d pixels; each side must be from 1 to %d", image.width, image.height, kMaxImageSide));
  if (colours == TJCS_CMYK || colours == TJCS_YCCK)
    return absl::InvalidArgumentError("JPEG: holds inks for print (CMYK); grey or RGB was expected");
  TOUCHSTONE_RETURN_IF_ERROR(CheckWholePicture(bytes));
  image.channels = colours == TJCS_GRAY ? 1 : 3;
  image.pixels.resize(static_cast<size_t>(image.width) * image.height * image.channels);
  if (tjDecompress2(handle, data, bytes.size(), image.pixels.data(), image.width, 0, image.height,
                    image.channels == 1 ? TJPF_GRAY : TJPF_RGB, TJFLAG_ACCURATEDCT) != 0)
    return absl::InvalidArgumentError(absl::StrCat("JPEG: pixels: ", tjGetErrorStr2(handle)));
  return image;
}

absl::StatusOr<PictureSize> PlainPngSize(absl::string_view png) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const OpenPng open, Open(png));
  return PlainSize(open.header);
}

absl::StatusOr<Image> DecodePlainPng(absl::string_view png) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const OpenPng open, Open(png));
  TOUCHSTONE_ASSIGN_OR_RETURN(const PictureSize size, PlainSize(open.header));
  TOUCHSTONE_ASSIGN_OR_RETURN(Image image, Decode(open, size.channels == 1));
  // The pixels may be whole although the end of the file is missing.
  TOUCHSTONE_RETURN_IF_ERROR(CheckWholePicture(png));
  if (int code = spng_decode_chunks(open.context.get()); code != 0) return BadPng("after the pixels", code);
  spng_trns transparency{};
  if (spng_get_trns(open.context.get(), &transparency) == 0)
    return absl::InvalidArgumentError("PNG: has transparency; opaque grey or RGB was expected");
  return image;
}

}  // namespace touchstone::image
