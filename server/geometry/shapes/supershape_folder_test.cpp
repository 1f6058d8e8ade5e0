#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>

#include "server/base/test_paths.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::geometry {
namespace {

const std::string kFolder = SourceDir() + "/meshes/";

TEST(SupershapeFolder, HoldsWhatTheCodeMakes) {
  const auto files = SupershapeFolderFiles();
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_EQ(files->size(), 11u);
  for (const NamedText& file : *files) {
    const absl::StatusOr<std::string> stored = ReadFile(kFolder + file.file);
    ASSERT_TRUE(stored.ok()) << stored.status();
    EXPECT_TRUE(*stored == file.text)
        << kFolder << file.file << " differs; WriteSupershapeFolder makes it anew";
  }
}

TEST(SupershapeFolder, FilesReadBackAsTheSameMesh) {
  const std::string manifest_text = ReadFile(kFolder + "manifest.json").value();
  const nlohmann::json manifest = nlohmann::json::parse(manifest_text);
  ASSERT_EQ(manifest["meshes"].size(), 5u);
  for (const auto& entry : manifest["meshes"]) {
    const std::string name = entry["name"];
    SCOPED_TRACE(name);
    const TriangleMesh made =
        MakeSupershape(NamedSupershape(name).value(), kSupershapeFolderTriangles).value();
    for (const auto& file : entry["files"]) {
      MeshImport import;
      import.unit = entry["unit"];
      import.up = entry["up"];
      const std::string path = kFolder + std::string(file["file"]);
      const absl::StatusOr<TriangleMesh> read = ReadMeshFile(path, import);
      ASSERT_TRUE(read.ok()) << read.status();
      EXPECT_EQ(MeshHash(*read), MeshHash(made));
      EXPECT_EQ(MeshHash(*read), entry["mesh_hash"]);
      EXPECT_EQ(read->triangles.size(), entry["triangles"]);
      EXPECT_EQ(Sha256HexOfFile(path).value(), file["sha256"]);
    }
  }
}

TEST(SupershapeFolder, CanBeWrittenAnywhereAndSaysWhereItCannot) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "touchstone_meshes";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(WriteSupershapeFolder(folder).ok());
  EXPECT_EQ(ReadFile(folder / "manifest.json").value(), ReadFile(kFolder + "manifest.json").value());
  std::filesystem::remove_all(folder);
  const absl::Status status = WriteSupershapeFolder(folder / "missing");
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("missing"), absl::string_view::npos) << status;
}

}  // namespace
}  // namespace touchstone::geometry
