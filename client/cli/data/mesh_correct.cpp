// touchstone mesh correct: the mesh as it was measured.
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/cli/options/mesh_options.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/effects/contact/surface_map.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/displace.h"
#include "server/model/surface_map_file.h"

namespace touchstone::cli {
namespace {

constexpr double kEdgesPerLength = 4;       // so many edges show a bump of one length
constexpr size_t kMaxSampledPlaces = 4000;  // where the standard deviation is worked out
constexpr double kKnownShare = 0.5;         // of the variance that the touches must have taken away
constexpr uint64_t kMaxMapBytes = 16 << 20;

// What the map says over the surface, by area.
struct CorrectionSummary {
  double rms_mm = 0, max_mm = 0;  // moved
  double touched_share = 0;       // of the area: the map knows more there than before any touch
  double std_dev_mm = 0;          // RMS over the touched share
};

CorrectionSummary SummaryOf(const geometry::TriangleMesh& mesh, const effects::SurfaceDeparture& departure) {
  const std::vector<double> area_m2 = geometry::AreaOfVertices(mesh);
  const size_t stride = 1 + mesh.vertices_m.size() / kMaxSampledPlaces;
  double all = 0, squares = 0, sampled = 0, touched = 0, variances = 0;
  CorrectionSummary summary;
  for (size_t v = 0; v < mesh.vertices_m.size(); ++v) {
    const Eigen::Vector3d place = mesh.vertices_m[v].cast<double>();
    const double moved_mm = departure.At(place) * kMillimetresPerMetre;
    all += area_m2[v], squares += area_m2[v] * moved_mm * moved_mm;
    if (area_m2[v] > 0) summary.max_mm = std::max(summary.max_mm, std::abs(moved_mm));
    if (v % stride != 0) continue;
    const double std_dev_m = departure.StdDevAt(place);
    sampled += area_m2[v];
    if (std_dev_m * std_dev_m > (1 - kKnownShare) * departure.rms_m() * departure.rms_m()) continue;
    touched += area_m2[v];
    variances += area_m2[v] * std_dev_m * std_dev_m;
  }
  if (all > 0) summary.rms_mm = std::sqrt(squares / all);
  if (sampled > 0) summary.touched_share = touched / sampled;
  if (touched > 0) summary.std_dev_mm = std::sqrt(variances / touched) * kMillimetresPerMetre;
  return summary;
}

absl::StatusOr<model::SurfaceMapObject> ObjectOfMap(const MeshOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(options.map, kMaxMapBytes));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto objects, model::ParseSurfaceMap(text, options.map));
  const std::string name =
      options.object.empty() ? std::filesystem::path(options.input).stem().string() : options.object;
  const auto found = objects.find(name);
  if (found != objects.end()) return found->second;
  std::vector<std::string> known;
  for (const auto& [other, object] : objects) known.push_back(other);
  return absl::NotFoundError(absl::StrCat(options.map, ": has no object '", name, "'",
                                          DidYouMean(name, known),
                                          "; --object NAME says which one the mesh is"));
}

}  // namespace

absl::Status RunMeshCorrect(const Cli& cli, const MeshOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::SurfaceMapObject object, ObjectOfMap(options));
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::TriangleMesh mesh, ReadMesh(cli, options));
  const effects::SurfaceDeparture departure(object);
  // Fine enough for the bumps, and at least as fine as it was.
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::TriangleMesh refined,
                              geometry::WithShortEdges(mesh, departure.length_m() / kEdgesPerLength,
                                                       geometry::MeshImport().max_triangles));
  const CorrectionSummary summary = SummaryOf(refined, departure);
  const geometry::TriangleMesh moved = geometry::MovedAlongNormals(
      refined, [&](const Eigen::Vector3d& point_m) { return departure.At(point_m); });
  TOUCHSTONE_RETURN_IF_ERROR(WriteMesh(cli, options, moved));
  if (cli.output().json || cli.output().quiet) return absl::OkStatus();
  return cli.Print(absl::StrFormat(
      "  Moved     by %.2g mm RMS, %.2g mm at most, along its normals; from %d to %d triangles\n"
      "  Touched   %.0f %% of the surface; there the map is known to %.2g mm. The rest stays as it was\n",
      summary.rms_mm, summary.max_mm, mesh.triangles.size(), moved.triangles.size(),
      100 * summary.touched_share, summary.std_dev_mm));
}

}  // namespace touchstone::cli
