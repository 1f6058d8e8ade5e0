// Text and messages that the readers of the mesh formats share.
#include <absl/strings/charconv.h>
#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <charconv>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

bool IsBlank(char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

}  // namespace

bool LineReader::Next() {
  if (!NextLine(&rest_, &line_)) return false;
  ++number_;
  return true;
}

bool LineReader::NextWithContent(char comment) {
  while (Next()) {
    if (comment != '\0') line_ = line_.substr(0, line_.find(comment));
    for (char c : line_)
      if (!IsBlank(c)) return true;
  }
  return false;
}

absl::string_view NextWord(absl::string_view* line) {
  size_t begin = 0;
  while (begin < line->size() && IsBlank((*line)[begin])) ++begin;
  size_t end = begin;
  while (end < line->size() && !IsBlank((*line)[end])) ++end;
  const absl::string_view word = line->substr(begin, end - begin);
  line->remove_prefix(end);
  return word;
}

bool ParseReal(absl::string_view word, double* value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  if (word.empty()) return false;
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  if (result.ec == std::errc::result_out_of_range) {
    // Too small is 0, too large is refused; only absl's version tells them apart.
    const auto again = absl::from_chars(word.data(), end, *value);
    return again.ptr == end && std::abs(*value) <= 1.0;
  }
  return result.ec == std::errc() && result.ptr == end && std::isfinite(*value);
}

bool IsReal(absl::string_view word) {
  double ignored;
  if (ParseReal(word, &ignored)) return true;
  // As C libraries print what is not finite: nan, -nan(ind), inf; 1.#QNAN, -1.#IND, 1.#INF.
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.remove_prefix(1);
  return absl::StartsWithIgnoreCase(word, "nan") || absl::StartsWithIgnoreCase(word, "inf") ||
         absl::StartsWith(word, "1.#");
}

bool ParseWhole(absl::string_view word, int64_t* value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  return !word.empty() && result.ec == std::errc() && result.ptr == end;
}

std::string Quoted(absl::string_view word) {
  if (word.empty()) return "nothing";
  constexpr size_t kMax = 40;
  return absl::StrCat("'", absl::CHexEscape(word.substr(0, kMax)), word.size() > kMax ? "...'" : "'");
}

absl::Status ParsePoint(const MeshReading& reading, absl::string_view* line, uint64_t line_number,
                        double point[3]) {
  for (int k = 0; k < 3; ++k) {
    const absl::string_view word = NextWord(line);
    if (!ParseReal(word, &point[k]))
      return reading.ErrorAtLine(
          line_number,
          absl::StrCat("found ", Quoted(word), " as the vertex's ", absl::string_view("xyz").substr(k, 1),
                       "; a vertex needs three finite numbers such as 12.5"));
  }
  return absl::OkStatus();
}

absl::Status MeshReading::ErrorAtLine(uint64_t line, absl::string_view what) const {
  if (line == 0) return Error(what);
  return absl::InvalidArgumentError(absl::StrCat(name_, ": line ", line, ": ", what));
}

absl::Status MeshReading::ErrorAtByte(uint64_t byte, absl::string_view what) const {
  return absl::InvalidArgumentError(absl::StrCat(name_, ": byte ", byte, ": ", what));
}

absl::Status MeshReading::Error(absl::string_view what) const {
  return absl::InvalidArgumentError(absl::StrCat(name_, ": ", what));
}

absl::Status MeshReading::CheckCount(uint64_t line, absl::string_view things, uint64_t count,
                                     uint64_t min_bytes, uint64_t bytes_left) const {
  // A last line may lack its line break.
  if (count > (bytes_left + 1) / std::max<uint64_t>(1, min_bytes))
    return ErrorAtLine(line,
                       absl::StrCat("the header promises ", count, " ", things, ", but the ", bytes_left,
                                    " bytes that follow cannot hold them; the file is cut off, or its "
                                    "header is wrong"));
  return absl::OkStatus();
}

absl::Status MeshReading::CheckVertexCount(uint64_t line, uint64_t count) const {
  if (count > limits_.max_vertices)
    return ErrorAtLine(line, absl::StrCat("more than ", limits_.max_vertices,
                                          " vertices; reduce the mesh before importing it"));
  return absl::OkStatus();
}

absl::Status MeshReading::CheckTriangleCount(uint64_t line, uint64_t count) const {
  if (count > limits_.max_triangles)
    return ErrorAtLine(line, absl::StrCat("more than ", limits_.max_triangles,
                                          " triangles; reduce the mesh before importing it"));
  return absl::OkStatus();
}

absl::Status MeshReading::AddPoint(const double point[3], uint64_t line) {
  for (int k = 0; k < 3; ++k) {
    if (!std::isfinite(point[k]))
      return ErrorAtLine(line, absl::StrCat("vertex ", mesh_.points.size(), " has the coordinate ", point[k],
                                            "; only finite numbers are places"));
  }
  if (mesh_.points.size() >= limits_.max_vertices) return CheckVertexCount(line, mesh_.points.size() + 1);
  mesh_.points.emplace_back(point[0], point[1], point[2]);
  return absl::OkStatus();
}

absl::Status MeshReading::AddFace(absl::Span<const uint32_t> corners, uint64_t line) {
  if (corners.size() < 3) {
    if (skipped_faces_++ == 0) first_skipped_line_ = line;
    return absl::OkStatus();
  }
  triangles_ += corners.size() - 2;
  if (triangles_ > limits_.max_triangles) return CheckTriangleCount(line, triangles_);
  mesh_.corners.insert(mesh_.corners.end(), corners.begin(), corners.end());
  mesh_.sizes.push_back(static_cast<uint32_t>(corners.size()));
  return absl::OkStatus();
}

void MeshReading::Note(absl::string_view what) {
  notes_.push_back(absl::StrCat(name_, ": ", what));
}

std::vector<std::string> MeshReading::Notes() const {
  std::vector<std::string> notes = notes_;
  if (skipped_faces_ > 0) {
    notes.push_back(absl::StrCat(name_,
                                 first_skipped_line_ > 0 ? absl::StrCat(": line ", first_skipped_line_) : "",
                                 ": ", skipped_faces_, skipped_faces_ == 1 ? " face has" : " faces have",
                                 " fewer than three corners; passed over"));
  }
  return notes;
}

}  // namespace touchstone::geometry
