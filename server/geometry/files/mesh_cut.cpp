// Whether a text that ends within a line has lost a part of its last face.
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstdlib>

#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

// The vertex that the last word of a text names, as it is written; empty where the word ends otherwise ("12/3/4").
std::optional<int64_t> LastNumber(absl::string_view text) {
  const size_t begin = text.find_last_of(" \t\r\n") + 1;
  int64_t number;
  if (!ParseWhole(text.substr(begin), &number)) return std::nullopt;
  return number;
}

}  // namespace

absl::Status MeshReading::CheckLastFace() const {
  if (bytes_.empty() || mesh_.sizes.size() < 2) return absl::OkStatus();
  const std::optional<int64_t> number = LastNumber(bytes_);
  const auto vertices = static_cast<int64_t>(mesh_.points.size());
  // A colour, a normal or a weight behind the face takes nothing from its shape. OBJ counts from 1, or back from the end.
  const int64_t last = mesh_.corners.back();
  if (!number || (*number != last && *number != last + 1 && *number + vertices != last))
    return absl::OkStatus();

  const size_t size = mesh_.sizes.back();
  const bool may_lack_digits = 10 * std::abs(*number) <= vertices && *number != 0;
  const bool may_lack_corners =
      std::all_of(mesh_.sizes.begin(), mesh_.sizes.end() - 1, [&](uint32_t other) { return other > size; });
  if (!may_lack_digits && !may_lack_corners) return absl::OkStatus();

  // Where each edge of the face meets a face that runs along it the other way, the face is whole.
  const uint32_t* const face = mesh_.corners.data() + mesh_.corners.size() - size;
  size_t met = 0;
  const uint32_t* other = mesh_.corners.data();
  for (size_t f = 0; f + 1 < mesh_.sizes.size(); other += mesh_.sizes[f++])
    for (uint32_t c = 0; c < mesh_.sizes[f]; ++c)
      for (size_t k = 0; k < size; ++k)
        met += other[c] == face[(k + 1) % size] && other[(c + 1) % mesh_.sizes[f]] == face[k];
  if (met >= size) return absl::OkStatus();
  LineReader lines(bytes_);
  while (lines.Next()) {
  }
  return ErrorAtLine(
      lines.number(),
      absl::StrCat("the file ends within its last line, and the last face, which ends with vertex ", *number,
                   ", leaves an edge open: ", may_lack_digits ? "a digit" : "a corner",
                   " may be cut off; write the file again, or end the line if it is whole"));
}

}  // namespace touchstone::geometry
