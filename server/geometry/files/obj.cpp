// OBJ, Wavefront's text format: one statement per line, a line that ends in \ continues in the next. Comments and names
// may end in \ too ("# exported to C:\parts\"); those end with their line.
//   v x y z [w | r g b]            a vertex
//   f v/vt/vn v/vt/vn v/vt/vn ...  a face; numbers count from 1, negative ones backwards from the last vertex
// Groups, materials, textures and normals shape nothing and are passed over, as are points and lines.
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <iterator>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

// Statements that the format knows and that do not matter here.
constexpr absl::string_view kPassedOver[] = {
    "vt",     "vn",         "vp",        "g",      "o",     "s",        "mg",
    "usemtl", "mtllib",     "usemap",    "maplib", "bevel", "c_interp", "d_interp",
    "lod",    "shadow_obj", "trace_obj", "l",      "p",     "call",     "csh"};
// Free-form curves and surfaces: shape that would be missing.
constexpr absl::string_view kFreeForm[] = {"deg",  "bmat", "step",  "cstype", "curv", "curv2",
                                           "surf", "parm", "trim",  "hole",   "scrv", "sp",
                                           "end",  "con",  "ctech", "stech"};

template <size_t n>
bool Holds(const absl::string_view (&words)[n], absl::string_view word) {
  return std::find(std::begin(words), std::end(words), word) != std::end(words);
}

class ObjReader {
 public:
  explicit ObjReader(MeshReading* reading) : reading_(reading), lines_(reading->bytes()) {}

  absl::Status Read() {
    while (NextStatement()) {
      absl::string_view rest = statement_;
      const absl::string_view keyword = NextWord(&rest);
      if (keyword.empty()) continue;
      if (keyword == "v") {
        TOUCHSTONE_RETURN_IF_ERROR(ReadVertex(rest));
      } else if (keyword == "f" || keyword == "fo") {
        TOUCHSTONE_RETURN_IF_ERROR(ReadFace(rest));
      } else if (Holds(kFreeForm, keyword)) {
        if (!free_form_noted_)
          reading_->Note(absl::StrCat("line ", line_, ": free-form curves and surfaces are passed over"));
        free_form_noted_ = true;
      } else if (!Holds(kPassedOver, keyword)) {
        return Error(absl::StrCat("found ", Quoted(keyword),
                                  ", which is no statement of OBJ; expected v, vn, vt, f, "
                                  "g, o, s, usemtl, mtllib, l, p or a comment that begins with #"));
      }
    }
    // Faces may stand before their vertices, so that this is known only now.
    if (highest_ >= reading_->mesh().points.size() && highest_line_ > 0)
      return reading_->ErrorAtLine(
          highest_line_, absl::StrCat("a face uses vertex ", highest_ + 1, ", but the file has ",
                                      reading_->mesh().points.size(), " vertices; it is cut off, or wrong"));
    return absl::OkStatus();
  }

 private:
  // The next statement with its continuation lines joined and its comment cut off.
  bool NextStatement() {
    if (!lines_.Next()) return false;
    line_ = lines_.number();
    statement_ = WithoutComment(lines_.line());
    absl::string_view rest = statement_;
    const absl::string_view keyword = NextWord(&rest);
    if (!Continues(statement_, keyword)) return true;
    joined_.clear();
    for (absl::string_view part = statement_;; part = WithoutComment(lines_.line())) {
      const bool more = Continues(part, keyword);
      if (more) part.remove_suffix(1);
      absl::StrAppend(&joined_, part, " ");
      if (!more || !lines_.Next()) break;
    }
    statement_ = joined_;
    return true;
  }

  static absl::string_view WithoutComment(absl::string_view line) { return line.substr(0, line.find('#')); }

  // Whether the statement of that keyword goes on in the next line. One that is passed over may end in a name: where the
  // next line is a statement itself, the \ was the name's last character.
  bool Continues(absl::string_view line, absl::string_view keyword) const {
    if (line.empty() || line.back() != '\\') return false;
    if (!Holds(kPassedOver, keyword.substr(0, keyword.find('\\')))) return true;
    LineReader ahead = lines_;
    if (!ahead.Next()) return false;
    absl::string_view next = ahead.line();
    const absl::string_view word = NextWord(&next);
    return !word.empty() && word[0] != '#' && word != "v" && word != "f" && word != "fo" &&
           !Holds(kPassedOver, word) && !Holds(kFreeForm, word);
  }

  absl::Status Error(absl::string_view what) const { return reading_->ErrorAtLine(line_, what); }

  absl::Status ReadVertex(absl::string_view rest) {
    double point[3];
    TOUCHSTONE_RETURN_IF_ERROR(ParsePoint(*reading_, &rest, line_, point));
    for (absl::string_view word = NextWord(&rest); !word.empty(); word = NextWord(&rest)) {
      if (!IsReal(word))  // a weight or a colour
        return Error(absl::StrCat("found ", Quoted(word), " behind a vertex; expected numbers only"));
    }
    return reading_->AddPoint(point, line_);
  }

  absl::Status ReadFace(absl::string_view rest) {
    const int64_t vertices = reading_->mesh().points.size();
    corners_.clear();
    for (absl::string_view word = NextWord(&rest); !word.empty(); word = NextWord(&rest)) {
      int64_t number;
      const size_t slash = word.find('/');
      if (!ParseWhole(word.substr(0, slash), &number) || !TextureAndNormalAreNumbers(word, slash))
        return Error(absl::StrCat("found ", Quoted(word),
                                  " as a corner of a face; expected v, v/vt, v//vn or "
                                  "v/vt/vn with whole numbers"));
      if (number == 0) return Error("a face uses vertex 0; the first vertex of an OBJ file has the number 1");
      const int64_t index = number > 0 ? number - 1 : vertices + number;
      if (index < 0)
        return Error(
            absl::StrCat("a face uses vertex ", number, ", but only ", vertices, " stand before it"));
      if (static_cast<uint64_t>(index) >= reading_->limits().max_vertices)
        return Error(absl::StrCat("a face uses vertex ", number, "; at most ",
                                  reading_->limits().max_vertices, " vertices are read"));
      if (static_cast<uint64_t>(index) > highest_ || highest_line_ == 0)
        highest_ = index, highest_line_ = line_;
      corners_.push_back(static_cast<uint32_t>(index));
    }
    return reading_->AddFace(corners_, line_);
  }

  // What stands behind the first slash: "", "vt", "/vn", "vt/vn" or, from some exporters, "/".
  static bool TextureAndNormalAreNumbers(absl::string_view word, size_t slash) {
    for (int parts = 0; slash != absl::string_view::npos; ++parts) {
      if (parts == 2) return false;
      word.remove_prefix(slash + 1);
      slash = word.find('/');
      int64_t ignored;
      const absl::string_view part = word.substr(0, slash);
      if (!part.empty() && !ParseWhole(part, &ignored)) return false;
    }
    return true;
  }

  MeshReading* reading_;
  LineReader lines_;
  absl::string_view statement_;
  std::string joined_;
  uint64_t line_ = 0;
  std::vector<uint32_t> corners_;
  uint64_t highest_ = 0;
  uint64_t highest_line_ = 0;
  bool free_form_noted_ = false;
};

}  // namespace

bool LooksLikeObj(absl::string_view bytes) {
  LineReader lines(bytes);
  if (!lines.NextWithContent('#')) return false;
  absl::string_view line = lines.line();
  const absl::string_view word = NextWord(&line);
  return word == "v" || word == "f" || Holds(kPassedOver, word);
}

absl::Status ReadObj(MeshReading* reading) {
  return ObjReader(reading).Read();
}

}  // namespace touchstone::geometry
