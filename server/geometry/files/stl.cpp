// STL, text and binary: a soup of triangles, each with corners of its own; equal corners become one vertex.
//   text    solid NAME  { facet normal x y z  outer loop  3 x vertex x y z  endloop  endfacet }  endsolid
//   binary  80 bytes of anything, a 32-bit count, then 50 bytes per triangle: normal, 3 corners (floats), 2
//   bytes
// A binary file whose size fits its count is binary even if its 80 bytes begin with "solid", as some do.
#include <absl/container/flat_hash_map.h>
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <cmath>
#include <cstring>

#include "server/base/status.h"
#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "binary STL is little-endian");
constexpr uint64_t kHeaderBytes = 84;
constexpr uint64_t kTriangleBytes = 50;

// Gives equal corners one vertex.
class Merger {
 public:
  explicit Merger(MeshReading* reading) : reading_(reading) {}

  absl::Status Add(const float corner[3], uint64_t line, uint32_t* vertex) {
    std::array<uint32_t, 3> bits;
    const double point[3] = {corner[0] + 0.0f, corner[1] + 0.0f, corner[2] + 0.0f};  // -0 is 0
    for (int k = 0; k < 3; ++k) {
      const float value = static_cast<float>(point[k]);
      std::memcpy(&bits[k], &value, sizeof value);
    }
    const auto [at, inserted] = vertex_at_.try_emplace(bits, reading_->mesh().points.size());
    *vertex = at->second;
    return inserted ? reading_->AddPoint(point, line) : absl::OkStatus();
  }

 private:
  MeshReading* reading_;
  absl::flat_hash_map<std::array<uint32_t, 3>, uint32_t> vertex_at_;
};

uint32_t CountAt80(absl::string_view bytes) {
  uint32_t count;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  return count;
}

bool HasTheSizeOfItsCount(absl::string_view bytes) {
  return bytes.size() >= kHeaderBytes && bytes.size() == kHeaderBytes + kTriangleBytes * CountAt80(bytes);
}

bool IsText(absl::string_view bytes) {
  if (HasTheSizeOfItsCount(bytes)) return false;
  const absl::string_view start = absl::StripLeadingAsciiWhitespace(bytes.substr(0, 1024));
  if (!absl::StartsWithIgnoreCase(start, "solid")) return false;
  // "solid" and then unprintable bytes is a binary file, cut off or with more behind it.
  for (unsigned char c : start)
    if (c == 0 || c == 0xFF) return false;
  return true;
}

absl::Status ReadBinary(MeshReading* reading) {
  const absl::string_view bytes = reading->bytes();
  if (bytes.size() < kHeaderBytes)
    return reading->Error(absl::StrCat("has ", bytes.size(),
                                       " bytes; a text STL begins with the word solid, and the "
                                       "header of a binary one alone has 84"));
  const uint64_t count = CountAt80(bytes);
  const uint64_t held = (bytes.size() - kHeaderBytes) / kTriangleBytes;
  if (count > held)
    return reading->ErrorAtByte(
        80, absl::StrCat("the header promises ", count, " triangles, but the bytes behind it hold ", held,
                         "; the file is cut off, or is no binary STL"));
  TOUCHSTONE_RETURN_IF_ERROR(reading->CheckTriangleCount(0, count));
  const uint64_t behind = bytes.size() - kHeaderBytes - count * kTriangleBytes;
  if (behind > 0) reading->Note(absl::StrCat(behind, " bytes behind the last triangle are passed over"));

  Merger merger(reading);
  for (uint64_t t = 0; t < count; ++t) {
    const uint64_t begin = kHeaderBytes + t * kTriangleBytes;
    float corners[9];
    std::memcpy(corners, bytes.data() + begin + 12, sizeof corners);
    uint32_t vertices[3];
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) {
        if (!std::isfinite(corners[3 * c + k]))
          return reading->ErrorAtByte(begin + 12 + 4 * (3 * c + k),
                                      absl::StrCat("triangle ", t, " has the coordinate ", corners[3 * c + k],
                                                   "; only finite numbers are places"));
      }
      TOUCHSTONE_RETURN_IF_ERROR(merger.Add(corners + 3 * c, 0, &vertices[c]));
    }
    TOUCHSTONE_RETURN_IF_ERROR(reading->AddFace(vertices, 0));
  }
  return absl::OkStatus();
}

// The text form, word by word: line breaks mean nothing but behind "solid" and "endsolid", where names stand.
class TextReader {
 public:
  explicit TextReader(MeshReading* reading) : reading_(reading), lines_(reading->bytes()), merger_(reading) {}

  absl::Status Read() {
    bool inside = false;
    for (absl::string_view word = Word(); !word.empty(); word = Word()) {
      if (Is(word, "solid") && !inside) {
        inside = true;
        rest_ = {};
      } else if (Is(word, "endsolid") && inside) {
        inside = false;
        rest_ = {};
      } else if (Is(word, "facet") && inside) {
        TOUCHSTONE_RETURN_IF_ERROR(ReadFacet());
      } else {
        return Unexpected(word, inside ? "facet or endsolid" : "solid");
      }
    }
    if (inside) return reading_->ErrorAtLine(lines_.number(), "the file ends before endsolid; it is cut off");
    return absl::OkStatus();
  }

 private:
  static bool Is(absl::string_view word, absl::string_view keyword) {
    return absl::EqualsIgnoreCase(word, keyword);
  }

  absl::string_view Word() {
    for (;;) {
      const absl::string_view word = NextWord(&rest_);
      if (!word.empty() || !lines_.Next()) return word;
      rest_ = lines_.line();
    }
  }

  absl::Status Unexpected(absl::string_view word, absl::string_view expected) const {
    if (word.empty())
      return reading_->ErrorAtLine(
          lines_.number(), absl::StrCat("the file ends where ", expected, " should stand; it is cut off"));
    return reading_->ErrorAtLine(lines_.number(),
                                 absl::StrCat("found ", Quoted(word), "; expected ", expected));
  }

  absl::Status Expect(absl::string_view keyword) {
    const absl::string_view word = Word();
    return Is(word, keyword) ? absl::OkStatus() : Unexpected(word, keyword);
  }

  absl::Status ReadFacet() {
    TOUCHSTONE_RETURN_IF_ERROR(Expect("normal"));
    for (int k = 0; k < 3; ++k) {
      // The corners' order says where outside is; a normal may even be nan.
      if (const absl::string_view word = Word(); word.empty() || Is(word, "outer"))
        return Unexpected(word, "the three numbers of the normal");
    }
    TOUCHSTONE_RETURN_IF_ERROR(Expect("outer"));
    TOUCHSTONE_RETURN_IF_ERROR(Expect("loop"));
    uint32_t vertices[3];
    for (uint32_t& vertex : vertices) {
      TOUCHSTONE_RETURN_IF_ERROR(Expect("vertex"));
      float corner[3];
      for (float& coordinate : corner) {
        const absl::string_view word = Word();
        double value;
        if (!ParseReal(word, &value)) return Unexpected(word, "a coordinate, a finite number");
        coordinate = static_cast<float>(value);
      }
      TOUCHSTONE_RETURN_IF_ERROR(merger_.Add(corner, lines_.number(), &vertex));
    }
    TOUCHSTONE_RETURN_IF_ERROR(Expect("endloop"));
    TOUCHSTONE_RETURN_IF_ERROR(Expect("endfacet"));
    return reading_->AddFace(vertices, lines_.number());
  }

  MeshReading* reading_;
  LineReader lines_;
  absl::string_view rest_;
  Merger merger_;
};

}  // namespace

bool LooksLikeStl(absl::string_view bytes) {
  return HasTheSizeOfItsCount(bytes) || IsText(bytes);
}

absl::Status ReadStl(MeshReading* reading) {
  if (reading->bytes().empty())
    return reading->Error(
        "the file is empty; a text STL begins with the word solid, a binary one has 84 bytes or more");
  return IsText(reading->bytes()) ? TextReader(reading).Read() : ReadBinary(reading);
}

}  // namespace touchstone::geometry
