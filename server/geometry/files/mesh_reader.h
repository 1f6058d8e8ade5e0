// What the readers of the mesh formats share; for the files beside this header only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/string_view.h>
#include <absl/types/span.h>
#include <Eigen/Core>

#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {

// A mesh as it stands in the file: its own unit and axes, faces with three corners or more.
struct PolygonMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<uint32_t> corners;  // of all faces, one after another
  std::vector<uint32_t> sizes;    // corners of each face
};

// A file under reading: its name and bytes, what has been found, and the errors' form.
class MeshReading {
 public:
  MeshReading(std::string name, absl::string_view bytes, const MeshImport& limits)
      : name_(std::move(name)), bytes_(bytes), limits_(limits) {}

  absl::string_view bytes() const { return bytes_; }
  const PolygonMesh& mesh() const { return mesh_; }
  PolygonMesh& mesh() { return mesh_; }
  const MeshImport& limits() const { return limits_; }

  // Errors: "cube.off: line 7: ...", "cube.stl: byte 84: ...", "cube.off: ...".
  absl::Status ErrorAtLine(uint64_t line, absl::string_view what) const;
  absl::Status ErrorAtByte(uint64_t byte, absl::string_view what) const;
  absl::Status Error(absl::string_view what) const;

  // Refuses counts of a header beyond the limits, or that `bytes_left` cannot hold at `min_bytes` for each.
  absl::Status CheckCount(uint64_t line, absl::string_view things, uint64_t count, uint64_t min_bytes,
                          uint64_t bytes_left) const;
  absl::Status CheckVertexCount(uint64_t line, uint64_t count) const;
  absl::Status CheckTriangleCount(uint64_t line, uint64_t count) const;

  // Adds a vertex; finite coordinates only. `line` 0: the file has none.
  absl::Status AddPoint(const double point[3], uint64_t line);

  // Adds a face of vertices that may still have to come; one of fewer than three corners is counted and
  // noted.
  absl::Status AddFace(absl::Span<const uint32_t> corners, uint64_t line);

  void Note(absl::string_view what);

  // After everything has been read: what was passed over, in words.
  std::vector<std::string> Notes() const;
  uint64_t skipped_faces() const { return skipped_faces_; }

  // Refuses a text without an end of its last line whose last face may have lost digits or corners: a further digit would
  // still name a vertex, or all other faces have more corners, and the face leaves an edge of its own open.
  absl::Status CheckLastFace() const;

 private:
  std::string name_;
  absl::string_view bytes_;
  const MeshImport& limits_;
  PolygonMesh mesh_;
  uint64_t triangles_ = 0;
  uint64_t skipped_faces_ = 0;
  uint64_t first_skipped_line_ = 0;
  std::vector<std::string> notes_;
};

// The formats. Each fills reading->mesh(); corners are checked to be below points.size() by the caller.
absl::Status ReadOff(MeshReading* reading);
absl::Status ReadObj(MeshReading* reading);
absl::Status ReadStl(MeshReading* reading);
absl::Status ReadPly(MeshReading* reading);

// Whether bytes begin as a file of the format does.
bool LooksLikeOff(absl::string_view bytes);
bool LooksLikeObj(absl::string_view bytes);
bool LooksLikeStl(absl::string_view bytes);
bool LooksLikePly(absl::string_view bytes);

// Lines of a text; they end in \n, \r\n or \r. The numbers count from 1.
class LineReader {
 public:
  explicit LineReader(absl::string_view text, uint64_t first_line = 1)
      : rest_(text), number_(first_line - 1) {}
  bool Next();                         // false: no line is left
  bool NextWithContent(char comment);  // skips empty lines and what follows `comment` ('\0': none)
  absl::string_view line() const { return line_; }
  uint64_t number() const { return number_; }
  uint64_t bytes_left() const { return rest_.size(); }
  absl::string_view rest() const { return rest_; }

 private:
  absl::string_view rest_;
  absl::string_view line_;
  uint64_t number_;
};

// Takes the next word off the front of `line`; empty: there is none.
absl::string_view NextWord(absl::string_view* line);

// The whole word as a finite number or a whole number; a leading + is allowed. Whatever the locale.
bool ParseReal(absl::string_view word, double* value);
bool ParseWhole(absl::string_view word, int64_t* value);

// Whether the word is a number, finite or not: what is passed over (colours, normals) may be nan.
bool IsReal(absl::string_view word);

// A word for a message: in quotes, at most 40 characters, unprintable ones escaped. "nothing" if empty.
std::string Quoted(absl::string_view word);

// The next three words as coordinates, or an error that says which one is wrong.
absl::Status ParsePoint(const MeshReading& reading, absl::string_view* line, uint64_t line_number,
                        double point[3]);

// Splits a face into triangles that keep its winding: ear clipping of its projection along its normal, a fan
// where the face is convex or has no area. Always appends polygon.size() - 2 triangles. `work` counts point
// tests over a whole file; beyond the limit corners are cut off as they come, and the caller refuses the
// file.
inline constexpr uint64_t kMaxTriangulationWork = 4'000'000'000;
void Triangulate(const std::vector<Eigen::Vector3d>& points, absl::Span<const uint32_t> polygon,
                 std::vector<std::array<uint32_t, 3>>* triangles, uint64_t* work);

}  // namespace touchstone::geometry
