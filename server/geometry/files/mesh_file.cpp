#include "server/geometry/files/mesh_file.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/text/utf16.h"
#include "server/base/units.h"
#include "server/geometry/files/mesh_reader.h"

namespace touchstone::geometry {
namespace {

constexpr absl::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr size_t kBytesThatShowAFormat = 4096;  // even: whole characters of UTF-16

// Coordinates beyond this are a wrong unit or a broken file; single precision would not carry them either.
constexpr double kFarthestM = 1e6;

struct Format {
  absl::string_view name;
  absl::Status (*read)(MeshReading*);
  bool (*looks_like)(absl::string_view bytes);
};
constexpr Format kFormats[] = {{"off", ReadOff, LooksLikeOff},
                               {"obj", ReadObj, LooksLikeObj},
                               {"stl", ReadStl, LooksLikeStl},
                               {"ply", ReadPly, LooksLikePly}};

struct MeshUnit {
  absl::string_view name;
  double metres;
};
constexpr MeshUnit kUnits[] = {{"mm", kMetresPerMillimetre}, {"cm", 1e-2}, {"m", 1.0}, {"inch", 25.4e-3}};

// Turns the file's axes into the object frame's, by a rotation, so that no mesh is mirrored.
struct UpAxis {
  absl::string_view name;
  Eigen::Vector3d (*object_from_file)(const Eigen::Vector3d&);
};
constexpr UpAxis kUpAxes[] = {
    {"z", [](const Eigen::Vector3d& p) { return p; }},
    {"y", [](const Eigen::Vector3d& p) { return Eigen::Vector3d(p.x(), -p.z(), p.y()); }},
    {"x", [](const Eigen::Vector3d& p) { return Eigen::Vector3d(-p.z(), p.y(), p.x()); }},
};

template <typename Row, size_t n>
std::vector<std::string> Names(const Row (&rows)[n]) {
  std::vector<std::string> names;
  for (const Row& row : rows) names.emplace_back(row.name);
  return names;
}

template <typename Row, size_t n>
const Row* FindNamed(const Row (&rows)[n], absl::string_view name) {
  for (const Row& row : rows)
    if (row.name == name) return &row;
  return nullptr;
}

std::string Extension(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  return dot == std::string::npos || path[dot] == '/' ? "" : absl::AsciiStrToLower(path.substr(dot + 1));
}

absl::Status CheckImport(const MeshImport& import) {
  TOUCHSTONE_RETURN_IF_ERROR(MetresPerMeshUnit(import.unit).status());
  if (FindNamed(kUpAxes, import.up) == nullptr)
    return absl::InvalidArgumentError(
        absl::StrCat("unknown up axis '", import.up, "'", DidYouMean(import.up, MeshUpAxisNames())));
  if (!(import.scale > 0) || !std::isfinite(import.scale))
    return absl::InvalidArgumentError(
        absl::StrCat("mesh scale ", import.scale, "; expected a number above 0"));
  if (!import.fit_mm) return absl::OkStatus();
  if (!(*import.fit_mm > 0) || !std::isfinite(*import.fit_mm))
    return absl::InvalidArgumentError(
        absl::StrCat("fit_mm ", *import.fit_mm, "; expected the length of the longest side in mm, above 0"));
  if (import.scale != 1 || import.unit != "mm")
    return absl::InvalidArgumentError(
        "fit_mm says how large the mesh becomes, so that unit and scale have no effect; give one or the "
        "other");
  return absl::OkStatus();
}

absl::Status CheckNotEmpty(const MeshReading& reading) {
  if (!reading.mesh().sizes.empty()) return absl::OkStatus();
  if (reading.mesh().points.empty()) return reading.Error("there is no vertex and no face in it");
  return reading.Error(absl::StrCat(
      "there are ", reading.mesh().points.size(), " vertices but no face",
      reading.skipped_faces() > 0 ? " with three corners" : "",
      ": points and lines have no surface that a finger could touch; export the object as a surface"));
}

// The factor from the file's numbers to metres.
absl::StatusOr<double> MetresPerFileUnit(const MeshReading& reading, const MeshImport& import) {
  if (!import.fit_mm) return FindNamed(kUnits, import.unit)->metres * import.scale;
  Eigen::Vector3d lower = Eigen::Vector3d::Constant(1e300), upper = -lower;
  for (uint32_t corner : reading.mesh().corners) {
    lower = lower.cwiseMin(reading.mesh().points[corner]);
    upper = upper.cwiseMax(reading.mesh().points[corner]);
  }
  const double longest = (upper - lower).maxCoeff();
  const double factor = *import.fit_mm * kMetresPerMillimetre / longest;
  if (!(longest > 0) || !std::isfinite(longest) || !std::isfinite(factor))
    return reading.Error(
        absl::StrCat("its longest side is ", longest, ", which no scale makes ", *import.fit_mm, " mm long"));
  return factor;
}

absl::StatusOr<TriangleMesh> Finish(const MeshReading& reading, const MeshImport& import) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckNotEmpty(reading));
  TOUCHSTONE_ASSIGN_OR_RETURN(const double factor, MetresPerFileUnit(reading, import));
  const auto object_from_file = FindNamed(kUpAxes, import.up)->object_from_file;
  const PolygonMesh& polygons = reading.mesh();

  TriangleMesh mesh;
  mesh.vertices_m.reserve(polygons.points.size());
  for (const Eigen::Vector3d& point : polygons.points) {
    const Eigen::Vector3d point_m = object_from_file(point) * factor;
    if (!(point_m.cwiseAbs().maxCoeff() <= kFarthestM))
      return reading.Error(
          absl::StrCat("vertex ", mesh.vertices_m.size(), " stands ", point_m.cwiseAbs().maxCoeff(),
                       " m from the origin, more than 1000 km; is ", import.unit, " the file's unit?"));
    mesh.vertices_m.push_back(point_m.cast<float>() + Eigen::Vector3f::Zero());  // -0 becomes 0
  }

  mesh.triangles.reserve(polygons.corners.size() - 2 * polygons.sizes.size());
  uint64_t begin = 0, work = 0;
  for (uint32_t size : polygons.sizes) {
    Triangulate(polygons.points, absl::MakeConstSpan(&polygons.corners[begin], size), &mesh.triangles, &work);
    begin += size;
    if (work > kMaxTriangulationWork)
      return reading.Error(
          "it has faces of too many corners to split into triangles; export it with triangles only");
  }

  bool has_area = false;
  for (uint32_t t = 0; t < mesh.triangles.size() && !has_area; ++t)
    has_area = !IsDegenerate(mesh.Corner(t, 0), mesh.Corner(t, 1), mesh.Corner(t, 2));
  if (!has_area)
    return reading.Error(absl::StrCat("none of its ", mesh.triangles.size(),
                                      " triangles has an area, so that there is nothing to touch"));
  return mesh;
}

}  // namespace

std::vector<std::string> MeshUnitNames() {
  return Names(kUnits);
}

absl::StatusOr<double> MetresPerMeshUnit(const std::string& unit) {
  if (const MeshUnit* found = FindNamed(kUnits, unit)) return found->metres;
  return absl::InvalidArgumentError(
      absl::StrCat("unknown mesh unit '", unit, "'", DidYouMean(unit, MeshUnitNames())));
}
std::vector<std::string> MeshUpAxisNames() {
  return Names(kUpAxes);
}
std::vector<std::string> MeshFormatNames() {
  return Names(kFormats);
}

absl::StatusOr<TriangleMesh> ReadMeshFile(const std::string& path, const MeshImport& import,
                                          std::vector<std::string>* notes) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckImport(import));
  if (FindNamed(kFormats, Extension(path)) == nullptr) {
    // A folder, or a file without an extension that is no mesh, may be large: its beginning says enough.
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return MeshFormatOf(path, "").status();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, import.max_bytes));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string format, MeshFormatOf(path, bytes));
  return ReadMeshBytes(path, format, bytes, import, notes);
}

absl::StatusOr<std::string> MeshFormatOf(const std::string& path, absl::string_view bytes) {
  const std::string extension = Extension(path);
  if (FindNamed(kFormats, extension) != nullptr) return extension;
  std::string text;
  if (IsUtf16(bytes)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(text, Utf8FromUtf16(bytes.substr(0, kBytesThatShowAFormat)));
    bytes = text;
  }
  absl::ConsumePrefix(&bytes, kByteOrderMark);
  for (const Format& format : kFormats)
    if (format.looks_like(bytes)) return std::string(format.name);
  return absl::InvalidArgumentError(absl::StrCat(path, ": the extension '", extension,
                                                 "' names no mesh format",
                                                 bytes.empty() ? "" : ", and the file begins like none",
                                                 "; known: ", absl::StrJoin(MeshFormatNames(), ", ")));
}

absl::StatusOr<TriangleMesh> ReadMeshBytes(const std::string& name, absl::string_view format,
                                           absl::string_view bytes, const MeshImport& import,
                                           std::vector<std::string>* notes) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckImport(import));
  const Format* reader = FindNamed(kFormats, format);
  if (reader == nullptr)
    return absl::InvalidArgumentError(absl::StrCat(name, ": unknown mesh format '", format, "'",
                                                   "; known: ", absl::StrJoin(MeshFormatNames(), ", ")));
  if (bytes.size() > import.max_bytes)
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": has ", bytes.size(), " bytes; at most ", import.max_bytes, " are read"));
  // A byte order mark is no part of any format, but some editors leave one.
  absl::ConsumePrefix(&bytes, kByteOrderMark);
  std::string utf8;
  if (IsUtf16(bytes)) {
    absl::StatusOr<std::string> text = Utf8FromUtf16(bytes);
    if (!text.ok()) return absl::InvalidArgumentError(absl::StrCat(name, ": ", text.status().message()));
    bytes = utf8 = *std::move(text);
  }
  MeshReading reading(name, bytes, import);
  if (absl::Status read = reader->read(&reading); !read.ok()) {
    // What another program called wrongly is told from what is damaged.
    for (const Format& other : kFormats)
      if (&other != reader && !reader->looks_like(bytes) && other.looks_like(bytes))
        return absl::InvalidArgumentError(absl::StrCat(read.message(),
                                                       "; the file begins like one of format ", other.name,
                                                       ": .", other.name, " would be its extension"));
    return read;
  }
  TOUCHSTONE_RETURN_IF_ERROR(reading.CheckLastFace());
  absl::StatusOr<TriangleMesh> mesh = Finish(reading, import);
  if (notes != nullptr) *notes = reading.Notes();
  return mesh;
}

}  // namespace touchstone::geometry
