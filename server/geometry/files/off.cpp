// OFF, the Object File Format of Geomview: a keyword, three counts, a vertex a line, a face a line.
//   [ST][C][N]OFF  vertices faces edges    the counts may stand behind the keyword
//   x y z [normal] [colour] [texture]
//   n i1 ... in [colour]
// http://www.geomview.org/docs/html/OFF.html
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include "server/base/status.h"
#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

struct Counts {
  uint64_t vertices = 0;
  uint64_t faces = 0;
};

// Takes [ST][C][N]OFF off the front of a word; false: it is something else.
bool ConsumeKeyword(absl::string_view* word) {
  absl::ConsumePrefix(word, "ST");
  absl::ConsumePrefix(word, "C");
  absl::ConsumePrefix(word, "N");
  return absl::ConsumePrefix(word, "OFF");
}

// Reads the keyword; what is left of its line stays in `line`.
absl::Status ReadKeyword(const MeshReading& reading, LineReader* lines, absl::string_view* line) {
  if (!lines->NextWithContent('#'))
    return reading.Error("the file is empty; an OFF file begins with the word OFF");
  *line = lines->line();
  absl::string_view word = NextWord(line);
  const absl::string_view whole = word;
  if (!ConsumeKeyword(&word))
    return reading.ErrorAtLine(lines->number(),
                               absl::StrCat("found ", Quoted(whole), "; an OFF file begins with the word OFF",
                                            " (three dimensions; 4OFF and nOFF are not read)"));
  // Some data sets forget the blank: "OFF490 518 0".
  if (!word.empty()) *line = absl::string_view(word.data(), line->data() + line->size() - word.data());
  absl::string_view peek = *line;
  if (NextWord(&peek) == "BINARY")
    return reading.ErrorAtLine(lines->number(),
                               "binary OFF is not read; save the mesh as text OFF or binary PLY");
  return absl::OkStatus();
}

absl::StatusOr<Counts> ReadCounts(const MeshReading& reading, LineReader* lines, absl::string_view line) {
  absl::string_view peek = line;
  if (NextWord(&peek).empty()) {
    if (!lines->NextWithContent('#'))
      return reading.ErrorAtLine(lines->number(),
                                 "the file ends before the counts of vertices, faces and edges");
    line = lines->line();
  }
  int64_t counts[2];
  for (int k = 0; k < 2; ++k) {
    const absl::string_view word = NextWord(&line);
    if (!ParseWhole(word, &counts[k]) || counts[k] < 0)
      return reading.ErrorAtLine(
          lines->number(),
          absl::StrCat("found ", Quoted(word), " as the number of ", k ? "faces" : "vertices",
                       "; expected whole numbers: vertices, faces, edges"));
  }
  const Counts result = {static_cast<uint64_t>(counts[0]), static_cast<uint64_t>(counts[1])};
  // "0 0 0\n" is the shortest vertex, "0\n" the shortest face.
  const uint64_t left = lines->bytes_left();
  TOUCHSTONE_RETURN_IF_ERROR(reading.CheckCount(lines->number(), "vertices", result.vertices, 6, left));
  TOUCHSTONE_RETURN_IF_ERROR(reading.CheckCount(lines->number(), "faces", result.faces, 2, left));
  TOUCHSTONE_RETURN_IF_ERROR(reading.CheckVertexCount(lines->number(), result.vertices));
  return result;
}

absl::Status ReadVertices(uint64_t count, LineReader* lines, MeshReading* reading) {
  reading->mesh().points.reserve(count);
  for (uint64_t v = 0; v < count; ++v) {
    if (!lines->NextWithContent('#'))
      return reading->ErrorAtLine(lines->number(), absl::StrCat("the file ends after ", v, " of ", count,
                                                                " vertices; it is cut off"));
    absl::string_view line = lines->line();
    double point[3];
    TOUCHSTONE_RETURN_IF_ERROR(ParsePoint(*reading, &line, lines->number(), point));
    // Behind the place: nothing, or a normal, a colour, texture coordinates; never a single number or two
    // unless a texture. A face's line in the vertices' place shows here.
    int more = 0;
    for (absl::string_view word = NextWord(&line); !word.empty(); word = NextWord(&line), ++more) {
      if (!IsReal(word))
        return reading->ErrorAtLine(lines->number(), absl::StrCat("found ", Quoted(word), " behind vertex ",
                                                                  v, "; expected numbers only"));
    }
    if (more == 1)
      return reading->ErrorAtLine(lines->number(),
                                  absl::StrCat("vertex ", v,
                                               " has four numbers; expected x y z, then nothing, a "
                                               "normal, a colour or texture coordinates"));
    TOUCHSTONE_RETURN_IF_ERROR(reading->AddPoint(point, lines->number()));
  }
  return absl::OkStatus();
}

absl::Status ReadFaces(uint64_t count, LineReader* lines, MeshReading* reading) {
  const int64_t vertices = reading->mesh().points.size();
  reading->mesh().sizes.reserve(count);
  reading->mesh().corners.reserve(3 * count);
  std::vector<uint32_t> corners;
  for (uint64_t f = 0; f < count; ++f) {
    if (!lines->NextWithContent('#'))
      return reading->ErrorAtLine(
          lines->number(), absl::StrCat("the file ends after ", f, " of ", count, " faces; it is cut off"));
    absl::string_view line = lines->line();
    const absl::string_view size_word = NextWord(&line);
    int64_t size;
    if (!ParseWhole(size_word, &size) || size < 0)
      return reading->ErrorAtLine(lines->number(), absl::StrCat("found ", Quoted(size_word),
                                                                " as the number of "
                                                                "corners of face ",
                                                                f, "; expected a whole number"));
    corners.clear();
    for (int64_t c = 0; c < size; ++c) {
      const absl::string_view word = NextWord(&line);
      int64_t index;
      if (!ParseWhole(word, &index) || index < 0 || index >= vertices)
        return reading->ErrorAtLine(
            lines->number(), absl::StrCat("found ", Quoted(word), " as corner ", c, " of ", size, " of face ",
                                          f, "; expected the number of a vertex, 0 to ", vertices - 1));
      corners.push_back(static_cast<uint32_t>(index));
    }
    // What follows is the face's colour.
    TOUCHSTONE_RETURN_IF_ERROR(reading->AddFace(corners, lines->number()));
  }
  return absl::OkStatus();
}

}  // namespace

bool LooksLikeOff(absl::string_view bytes) {
  LineReader lines(bytes);
  if (!lines.NextWithContent('#')) return false;
  absl::string_view line = lines.line();
  absl::string_view word = NextWord(&line);
  return ConsumeKeyword(&word);
}

absl::Status ReadOff(MeshReading* reading) {
  LineReader lines(reading->bytes());
  absl::string_view line;
  TOUCHSTONE_RETURN_IF_ERROR(ReadKeyword(*reading, &lines, &line));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Counts counts, ReadCounts(*reading, &lines, line));
  TOUCHSTONE_RETURN_IF_ERROR(ReadVertices(counts.vertices, &lines, reading));
  TOUCHSTONE_RETURN_IF_ERROR(ReadFaces(counts.faces, &lines, reading));
  if (!lines.NextWithContent('#')) return absl::OkStatus();
  // Some programs leave notes of their own behind the mesh; a number there is one face more than promised.
  line = lines.line();
  double number;
  if (ParseReal(NextWord(&line), &number))
    return reading->ErrorAtLine(
        lines.number(), absl::StrCat("found ", Quoted(lines.line()), " behind the last of ", counts.faces,
                                     " faces; the header's counts are wrong"));
  reading->Note(absl::StrCat("line ", lines.number(),
                             ": passed over what stands behind the last face: ", Quoted(lines.line())));
  return absl::OkStatus();
}

}  // namespace touchstone::geometry
