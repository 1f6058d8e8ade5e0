// Meshes that other people's tools wrote: what loads, what is refused, and how both are told.
#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/base/test_paths.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

const std::string kCorpus = SharedData() + "/meshes";

struct Row {
  std::string path;
  std::string expected_class;  // valid, awkward or invalid
  int64_t triangles = -1;
  int64_t polygons = 0;  // faces of more than three corners
  int64_t boundary_edges = -1;
  int64_t nonmanifold_edges = -1;
};

std::vector<Row> ReadIndex() {
  const absl::StatusOr<std::string> text = ReadFile(kCorpus + "/INDEX.tsv");
  std::vector<Row> rows;
  if (!text.ok()) return rows;
  const std::vector<std::string> lines = absl::StrSplit(*text, '\n', absl::SkipEmpty());
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> cells = absl::StrSplit(lines[i], '\t');
    Row row;
    row.path = cells[0];
    row.expected_class = cells[7];
    (void)absl::SimpleAtoi(cells[2], &row.triangles);
    (void)absl::SimpleAtoi(cells[3], &row.polygons);
    (void)absl::SimpleAtoi(cells[4], &row.boundary_edges);
    (void)absl::SimpleAtoi(cells[5], &row.nonmanifold_edges);
    rows.push_back(row);
  }
  return rows;
}

TEST(MeshCorpus, LoadsWhatIsAMeshAndRefusesWhatIsNot) {
  const std::vector<Row> rows = ReadIndex();
  if (rows.empty()) GTEST_SKIP() << "no meshes to test on at " << kCorpus;
  EXPECT_GE(rows.size(), 84u);
  for (const Row& row : rows) {
    SCOPED_TRACE(row.path);
    const std::string path = kCorpus + "/" + row.path;
    std::vector<std::string> notes;
    const absl::StatusOr<TriangleMesh> mesh = ReadMeshFile(path, MeshImport(), &notes);
    if (row.expected_class == "invalid") {
      EXPECT_FALSE(mesh.ok());
      // The reason names the file first and then says something.
      EXPECT_THAT(std::string(mesh.status().message()), testing::StartsWith(path + ": "));
      EXPECT_GT(mesh.status().message().size(), path.size() + 20);
      continue;
    }
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(static_cast<int64_t>(mesh->triangles.size()), row.triangles);
    const MeshReport report = InspectMesh(*mesh);
    // The index splits polygons as fans, which breaks concave ones; triangles can be compared.
    if (row.polygons == 0) {
      EXPECT_EQ(static_cast<int64_t>(report.boundary_edges), row.boundary_edges);
      EXPECT_EQ(static_cast<int64_t>(report.nonmanifold_edges), row.nonmanifold_edges);
    }
    if (row.expected_class == "valid") {
      EXPECT_TRUE(report.closed());
      EXPECT_EQ(report.inconsistent_edges, 0u);
      EXPECT_EQ(report.degenerate_triangles, 0u);
      EXPECT_EQ(report.duplicate_triangles, 0u);
    }
    const MeshReport cleaned = InspectMesh(WithoutDegenerateAndDuplicate(*mesh));
    EXPECT_EQ(cleaned.degenerate_triangles, 0u);
    EXPECT_EQ(cleaned.duplicate_triangles, 0u);
    EXPECT_GT(cleaned.triangles, 0u);
  }
}

TEST(MeshCorpus, EverydayModelsLoadAndScale) {
  const std::string folder = SharedData() + "/psb10";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no everyday models at " << folder;
  int models = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".off") continue;
    SCOPED_TRACE(entry.path());
    MeshImport import;
    import.fit_mm = 150;
    import.up = "y";
    const absl::StatusOr<TriangleMesh> mesh = ReadMeshFile(entry.path(), import);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    const Bounds bounds = ComputeBounds(*mesh);
    EXPECT_NEAR((bounds.max_m - bounds.min_m).maxCoeff(), 0.150, 1e-7);
    ++models;
  }
  EXPECT_EQ(models, 10);
}

}  // namespace
}  // namespace touchstone::geometry
