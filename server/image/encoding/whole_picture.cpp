#include "server/image/encoding/whole_picture.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <vector>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <turbojpeg.h>

namespace touchstone::image {
namespace {

absl::Status CutOff(absl::string_view format, absl::string_view missing, size_t bytes) {
  return absl::InvalidArgumentError(
      absl::StrCat(format, ": ", missing, " after ", bytes, " bytes; the picture is cut off"));
}

struct TurboDelete {
  void operator()(void* handle) const { tjDestroy(handle); }
};
constexpr tjscalingfactor kEighth = {1, 8};

// Whole numbers of a file in the order of its bytes; 0 beyond its end.
class Reader {
 public:
  Reader(absl::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}
  uint64_t Number(uint64_t at, int size) const {
    if (at + size > bytes_.size()) return 0;
    uint64_t value = 0;
    for (int i = 0; i < size; ++i)
      value = value << 8 | static_cast<uint8_t>(bytes_[at + (big_endian_ ? i : size - 1 - i)]);
    return value;
  }
  uint64_t size() const { return bytes_.size(); }

 private:
  absl::string_view bytes_;
  bool big_endian_;
};

// Where the next marker behind entropy-coded data is: 0xFF that is neither stuffed (00), nor a restart (D0 to D7), nor
// a fill byte (FF).
size_t EndOfScan(absl::string_view bytes, size_t at) {
  for (; at + 1 < bytes.size(); ++at) {
    if (bytes[at] != '\xFF') continue;
    const uint8_t code = static_cast<uint8_t>(bytes[at + 1]);
    if (code != 0 && code != 0xFF && (code < 0xD0 || code > 0xD7)) return at;
  }
  return bytes.size();
}

// Every code of the scans, at an eighth of the size: a scan that was cut and got an end marker all the same has one.
absl::Status CheckScans(absl::string_view bytes) {
  constexpr int kMaxSide = 16384;
  const std::unique_ptr<void, TurboDelete> handle(tjInitDecompress());
  if (handle == nullptr) return absl::ResourceExhaustedError("JPEG: no memory for a decoder");
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  int width = 0, height = 0, sampling = 0, colours = 0;
  if (tjDecompressHeader3(handle.get(), data, bytes.size(), &width, &height, &sampling, &colours) != 0)
    return absl::InvalidArgumentError(absl::StrCat("JPEG: header: ", tjGetErrorStr2(handle.get())));
  if (width > kMaxSide || height > kMaxSide)
    return absl::InvalidArgumentError(
        absl::StrCat("JPEG: is ", width, " x ", height, " pixels; each side must be at most ", kMaxSide));
  const bool inks = colours == TJCS_CMYK || colours == TJCS_YCCK;
  const int small_width = TJSCALED(width, kEighth), small_height = TJSCALED(height, kEighth);
  std::vector<unsigned char> pixels(size_t{1} * small_width * small_height * (inks ? 4 : 1));
  if (tjDecompress2(handle.get(), data, bytes.size(), pixels.data(), small_width, 0, small_height,
                    inks ? TJPF_CMYK : TJPF_GRAY, TJFLAG_FASTDCT | TJFLAG_STOPONWARNING) != 0)
    return absl::InvalidArgumentError(
        absl::StrCat("JPEG: the picture is damaged: ", tjGetErrorStr2(handle.get())));
  return absl::OkStatus();
}

absl::Status CheckJpeg(absl::string_view bytes) {
  constexpr uint8_t kEnd = 0xD9, kScan = 0xDA;
  const Reader reader(bytes, true);
  bool scanned = false;
  for (size_t at = 2; at + 1 < bytes.size();) {
    if (bytes[at] != '\xFF')
      return absl::InvalidArgumentError(
          absl::StrCat("JPEG: no marker at byte ", at, ", where one was expected; the picture is damaged"));
    const uint8_t code = static_cast<uint8_t>(bytes[at + 1]);
    if (code == 0xFF) {
      ++at;
      continue;
    }
    if (code == kEnd)
      return scanned ? CheckScans(bytes)
                     : absl::InvalidArgumentError("JPEG: ends without a scan; the picture is damaged");
    const uint64_t length = reader.Number(at + 2, 2);
    at += 2 + std::max<uint64_t>(length, 2);
    if (at >= bytes.size()) break;
    if (code != kScan) continue;
    scanned = true;
    at = EndOfScan(bytes, at);
  }
  return CutOff("JPEG", "no end marker (EOI)", bytes.size());
}

absl::Status CheckPng(absl::string_view bytes) {
  static constexpr absl::string_view kEnd("\0\0\0\0IEND\xAE\x42\x60\x82", 12);
  const Reader reader(bytes, true);
  for (uint64_t at = 8; at + kEnd.size() <= bytes.size(); at += kEnd.size() + reader.Number(at, 4)) {
    if (bytes.substr(at + 4, 4) != "IEND") continue;
    if (bytes.substr(at) == kEnd) return absl::OkStatus();
    return absl::InvalidArgumentError("PNG: does not end with its last chunk (IEND)");
  }
  return CutOff("PNG", "does not end with its last chunk (IEND)", bytes.size());
}

// Rows are filled up to multiples of four bytes (Microsoft, BITMAPINFOHEADER).
absl::Status CheckBmp(absl::string_view bytes) {
  const Reader reader(bytes, false);
  const uint64_t pixels_at = reader.Number(10, 4), width = reader.Number(18, 4), bits = reader.Number(28, 2);
  const uint64_t rows = std::abs(static_cast<int64_t>(static_cast<int32_t>(reader.Number(22, 4))));
  const uint64_t compression = reader.Number(30, 4);
  if (bytes.size() < 54) return CutOff("BMP", "no header", bytes.size());
  // Uncompressed, or with bit fields; run lengths say their size in the header.
  const uint64_t size =
      compression == 0 || compression == 3 ? (width * bits + 31) / 32 * 4 * rows : reader.Number(34, 4);
  if (pixels_at + size > bytes.size() || size == 0) return CutOff("BMP", "pixels are missing", bytes.size());
  return absl::OkStatus();
}

// P5 and P6 (netpbm): width, height and largest value as text with comments, one space, the samples.
absl::Status CheckPnm(absl::string_view bytes) {
  size_t at = 2;
  uint64_t header[3] = {};
  for (uint64_t& number : header) {
    while (at < bytes.size() && (absl::ascii_isspace(bytes[at]) || bytes[at] == '#'))
      at = bytes[at] == '#' ? std::min(bytes.find('\n', at), bytes.size()) : at + 1;
    const size_t from = at;
    while (at < bytes.size() && absl::ascii_isdigit(bytes[at])) ++at;
    if (!absl::SimpleAtoi(bytes.substr(from, at - from), &number) || number > 65535)
      return CutOff("PNM", "no header", bytes.size());
  }
  const uint64_t samples = header[0] * header[1] * (bytes[1] == '6' ? 3 : 1);
  const uint64_t size = samples * (header[2] > 255 ? 2 : 1);
  if (size == 0 || at + 1 + size > bytes.size()) return CutOff("PNM", "pixels are missing", bytes.size());
  return absl::OkStatus();
}

// TIFF 6.0: every strip (tags 273, 279) or tile (324, 325) of the first picture.
absl::Status CheckTiff(absl::string_view bytes) {
  const Reader reader(bytes, bytes[0] == 'M');
  if (reader.Number(2, 2) != 42)
    return absl::InvalidArgumentError("TIFF: is a BigTIFF; plain TIFF was expected");
  const uint64_t directory = reader.Number(4, 4), entries = reader.Number(directory, 2);
  struct List {
    uint64_t at = 0, count = 0;
    int size = 4;
  };
  std::optional<List> offsets, counts;
  for (uint64_t k = 0; k < entries; ++k) {
    const uint64_t entry = directory + 2 + 12 * k, tag = reader.Number(entry, 2);
    List list;
    list.size = reader.Number(entry + 2, 2) == 3 ? 2 : 4;
    list.count = reader.Number(entry + 4, 4);
    list.at = list.count * list.size <= 4 ? entry + 8 : reader.Number(entry + 8, 4);
    if (tag == 273 || tag == 324) offsets = list;
    if (tag == 279 || tag == 325) counts = list;
  }
  const auto cut = CutOff("TIFF", "pixels are missing", bytes.size());
  if (!offsets.has_value() || !counts.has_value() || offsets->count == 0 || offsets->count != counts->count)
    return cut;
  for (const List& list : {*offsets, *counts})
    if (list.at + list.count * list.size > reader.size()) return cut;
  for (uint64_t k = 0; k < offsets->count; ++k) {
    const uint64_t at = reader.Number(offsets->at + k * offsets->size, offsets->size),
                   size = reader.Number(counts->at + k * counts->size, counts->size);
    if (at == 0 || size == 0 || at + size > reader.size()) return cut;
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckWholePicture(absl::string_view bytes) {
  if (absl::StartsWith(bytes, "\xFF\xD8")) return CheckJpeg(bytes);
  if (absl::StartsWith(bytes, absl::string_view("\x89PNG\r\n\x1A\n", 8))) return CheckPng(bytes);
  if (absl::StartsWith(bytes, "BM")) return CheckBmp(bytes);
  if (absl::StartsWith(bytes, "P5") || absl::StartsWith(bytes, "P6")) return CheckPnm(bytes);
  if (absl::StartsWith(bytes, "II") || absl::StartsWith(bytes, "MM")) return CheckTiff(bytes);
  return absl::InvalidArgumentError(
      "is no picture of a known format; PNG, JPEG, BMP, PGM, PPM or TIFF was expected");
}

}  // namespace touchstone::image
