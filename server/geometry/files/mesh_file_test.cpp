#include "server/geometry/files/mesh_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <cstring>
#include <filesystem>

#include "server/base/files/file_writer.h"
#include "server/base/numbers/random.h"
#include "server/base/text/text.h"

namespace touchstone::geometry {
namespace {

using testing::HasSubstr;

// A box of 1 x 2 x 3 file units with a corner at the origin, as a tetrahedron of its corners.
const char kBox[] = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

absl::StatusOr<TriangleMesh> Read(const MeshImport& import, const std::string& text = kBox) {
  return ReadMeshBytes("t.off", "off", text, import);
}

std::string Refusal(const MeshImport& import, const std::string& text = kBox) {
  return std::string(Read(import, text).status().message());
}

class MeshFile : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  const std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) / "touchstone_mesh_file";
};

TEST(MeshImport, UnitsAndScaleMultiply) {
  const std::pair<const char*, double> units[] = {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}, {"inch", 0.0254}};
  for (const auto& [unit, metres] : units)
    for (double scale : {1.0, 0.5, 7.0}) {
      MeshImport import;
      import.unit = unit;
      import.scale = scale;
      EXPECT_EQ(Read(import)->vertices_m[3].z(), static_cast<float>(3 * (metres * scale))) << unit;
    }
  EXPECT_THAT(MeshUnitNames(), testing::ElementsAre("mm", "cm", "m", "inch"));
}

TEST(MeshImport, TheUpAxisIsTurnedNotMirrored) {
  for (const std::string& up : MeshUpAxisNames()) {
    MeshImport import;
    import.up = up;
    import.unit = "m";
    const TriangleMesh mesh = *Read(import);
    const int axis = up[0] - 'x';
    EXPECT_EQ(mesh.vertices_m[axis + 1], Eigen::Vector3f(0, 0, axis + 1)) << up << " must point up";
    EXPECT_NEAR(InspectMesh(mesh).signed_volume_m3, 1, 1e-6) << up << " must keep the outside outside";
  }
}

TEST(MeshImport, FitMakesTheLongestSideThatLongAndIgnoresStrayVertices) {
  MeshImport import;
  import.fit_mm = 150;
  const std::string stray =
      "OFF\n5 4 0\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n900 0 0\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
  for (const std::string& text : {std::string(kBox), stray}) {
    const Bounds bounds = ComputeBounds(*Read(import, text));
    EXPECT_FLOAT_EQ(bounds.max_m.z(), 0.150f);
    EXPECT_FLOAT_EQ(bounds.max_m.x(), 0.050f);
  }
}

TEST(MeshImport, RefusesWhatItDoesNotKnow) {
  MeshImport import;
  import.unit = "inches";
  EXPECT_THAT(Refusal(import), HasSubstr("unknown mesh unit 'inches', did you mean 'inch'?"));
  import = {};
  import.up = "w";
  EXPECT_THAT(Refusal(import), HasSubstr("unknown up axis 'w'"));
  for (double scale : {0.0, -1.0, std::nan(""), 1.0 / 0.0}) {
    import = {};
    import.scale = scale;
    EXPECT_THAT(Refusal(import), HasSubstr("expected a number above 0"));
    import = {};
    import.fit_mm = scale;
    EXPECT_THAT(Refusal(import), HasSubstr("above 0"));
  }
  import = {};
  import.fit_mm = 150;
  import.scale = 2;
  EXPECT_THAT(Refusal(import), HasSubstr("give one or the other"));
}

TEST(MeshImport, RefusesMeshesBeyondItsLimits) {
  MeshImport import;
  import.max_triangles = 3;
  EXPECT_THAT(Refusal(import), HasSubstr("line 10: more than 3 triangles"));
  import = {};
  import.max_vertices = 3;
  EXPECT_THAT(Refusal(import), HasSubstr("line 2: more than 3 vertices"));
  import = {};
  import.max_bytes = 20;
  EXPECT_THAT(Refusal(import), HasSubstr("at most 20 are read"));
}

TEST(MeshImport, RefusesPlacesThatNoUnitExplains) {
  MeshImport import;
  import.unit = "m";
  EXPECT_THAT(Refusal(import, "OFF\n3 1 0\n0 0 0\n1e7 0 0\n0 1 0\n3 0 1 2\n"),
              HasSubstr("vertex 1 stands 1e+07 m from the origin, more than 1000 km; is m the file's unit?"));
  EXPECT_THAT(Refusal({}, "OFF\n3 1 0\n0 0 0\n1e300 0 0\n0 1e300 0\n3 0 1 2\n"), HasSubstr("1000 km"));
}

TEST(MeshImport, RefusesMeshesWithoutArea) {
  EXPECT_THAT(Refusal({}, "OFF\n3 1 0\n0 0 0\n1 1 1\n2 2 2\n3 0 1 2\n"),
              HasSubstr("none of its 1 triangles has an area"));
  MeshImport fit;
  fit.fit_mm = 150;
  EXPECT_THAT(Refusal(fit, "OFF\n3 1 0\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n"), HasSubstr("its longest side is 0"));
}

TEST(MeshImport, NumbersDoNotHangOnTheLocale) {
  const std::string before = std::setlocale(LC_ALL, nullptr);
  for (const char* locale : {"de_DE.UTF-8", "de_DE.utf8", "C.UTF-8"}) std::setlocale(LC_ALL, locale);
  EXPECT_EQ(Read({}, "OFF\n3 1 0\n0 0 0\n1.5 0 0\n0 2.25e-1 0\n3 0 1 2\n")->vertices_m[1].x(), 1.5e-3f);
  std::setlocale(LC_ALL, before.c_str());
}

TEST_F(MeshFile, TheExtensionNamesTheFormatInAnyCase) {
  const std::string path = folder_ / "box.OfF";
  ASSERT_TRUE(WriteFileAtomically(path, kBox).ok());
  EXPECT_TRUE(ReadMeshFile(path).ok());
  EXPECT_THAT(std::string(ReadMeshFile(folder_ / "box.step").status().message()),
              HasSubstr("names no mesh format; known: off, obj, stl, ply"));
  EXPECT_THAT(std::string(ReadMeshFile(folder_ / "off").status().message()),
              HasSubstr("names no mesh format"));
  EXPECT_THAT(std::string(ReadMeshFile(folder_ / "absent.off").status().message()), HasSubstr("absent.off"));
  EXPECT_FALSE(ReadMeshFile(folder_ / ".off").ok());
}

TEST_F(MeshFile, WithoutAnExtensionBeginsAsItsFormatDoes) {
  const std::string
      obj = "# a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
      ply =
          "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
          "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 "
          "2\n";
  const std::string stl =
      "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "endsolid\n";
  for (const std::string& bytes : {std::string(kBox), obj, ply, stl, "\xEF\xBB\xBF" + obj})
    for (const char* name : {"mesh", "mesh.txt"}) {
      const std::string path = folder_ / name;
      std::filesystem::remove(path);
      ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
      EXPECT_TRUE(ReadMeshFile(path).ok()) << ReadMeshFile(path).status() << bytes;
    }
  const std::string path = folder_ / "letter";
  ASSERT_TRUE(WriteFileAtomically(path, "Dear all,\n").ok());
  EXPECT_THAT(std::string(ReadMeshFile(path).status().message()),
              HasSubstr("names no mesh format, and the file begins like none; known: off, obj, stl, ply"));
}

TEST(MeshImport, AFileOfAnotherFormatIsNamed) {
  EXPECT_THAT(std::string(ReadMeshBytes("t.obj", "obj", kBox).status().message()),
              HasSubstr("begins like one of format off: .off would be its extension"));
}

TEST(MeshImport, Utf16IsRead) {
  std::string bytes = "\xFF\xFE";
  for (const char* c = kBox; *c != 0; ++c) bytes += {*c, '\0'};
  const auto mesh = ReadMeshBytes("t.off", "off", bytes);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles, ReadMeshBytes("t.off", "off", kBox)->triangles);
  EXPECT_THAT(
      std::string(ReadMeshBytes("t.off", "off", bytes.substr(0, bytes.size() - 1)).status().message()),
      HasSubstr("ends within a character"));
}

// A tetrahedron whose vertices have the numbers 40 to 43 of 44, with the last corner written as `last`.
std::string TetrahedronEndingWith(const std::string& last, int first_index) {
  std::string text = first_index == 1 ? "" : "OFF\n44 4 0\n";
  const char* const v = first_index == 1 ? "v " : "";
  for (int k = 0; k < 40; ++k) absl::StrAppend(&text, v, k, " 7 7\n");
  for (const char* corner : {"0 0 0", "50 0 0", "0 50 0", "0 0 50"}) absl::StrAppend(&text, v, corner, "\n");
  const auto face = [&](int a, int b) {
    return absl::StrCat(first_index == 1 ? "f " : "3 ", a + first_index, " ", b + first_index, " ");
  };
  absl::StrAppend(&text, face(40, 42), 41 + first_index, "\n", face(40, 41), 43 + first_index, "\n",
                  face(40, 43), 42 + first_index, "\n", face(41, 42), last);
  return text;
}

TEST(MeshImport, ALastLineCutWithinANumberIsRefusedWithItsLine) {
  for (const auto& [format, first] : {std::pair<const char*, int>{"off", 0}, {"obj", 1}}) {
    const std::string whole = absl::StrCat(43 + first);
    EXPECT_TRUE(ReadMeshBytes("t", format, TetrahedronEndingWith(whole, first)).ok()) << format;
    EXPECT_TRUE(ReadMeshBytes("t", format, TetrahedronEndingWith(whole + "\n", first)).ok());
    EXPECT_THAT(std::string(ReadMeshBytes("t", format, TetrahedronEndingWith("4", first)).status().message()),
                AllOf(HasSubstr(first == 0 ? "line 50: " : "line 48: "), HasSubstr("ends with vertex 4"),
                      HasSubstr("a digit may be cut off")));
    // With the line's end it stands there as it was meant.
    EXPECT_TRUE(ReadMeshBytes("t", format, TetrahedronEndingWith("4\n", first)).ok());
  }
}

TEST_F(MeshFile, WrittenMeshesReadBackBitForBit) {
  // Floats of every magnitude that a mesh may have, and their neighbours.
  TriangleMesh mesh;
  for (uint64_t i = 0; i < 30'000; ++i) {
    RandomStream random(3, RandomDomain::kTest, i);
    Eigen::Vector3f place_m;
    for (int k = 0; k < 3; ++k) {
      const double size = std::pow(10.0, i % 3 == 0 ? random.Uniform(-45, 5.9) : random.Uniform(-4, 0));
      place_m[k] = static_cast<float>(random.Below(2) == 0 ? size : -size);
    }
    if (i % 7 == 0) place_m.x() = 0.001f * static_cast<float>(i % 1000);
    mesh.vertices_m.push_back(place_m + Eigen::Vector3f::Zero());
  }
  for (uint32_t i = 0; i + 2 < mesh.vertices_m.size(); ++i) mesh.triangles.push_back({i, i + 1, i + 2});
  for (const std::string& format : WritableMeshFormatNames()) {
    const std::string path = folder_ / ("mesh." + format);
    ASSERT_TRUE(WriteMeshFile(path, mesh).ok());
    const absl::StatusOr<TriangleMesh> read = ReadMeshFile(path);
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(MeshHash(*read), MeshHash(mesh)) << format;
  }
}

TEST(MeshWriter, NumbersAreShort) {
  TriangleMesh mesh;
  mesh.vertices_m = {{0.0f, -0.0f, 0.0753f}, {0.1f, 0.00025f, -1e-9f}, {1.0f / 3, 1000, 0.075f}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(MeshFileText(mesh, "off").value(),
            "OFF\n3 1 0\n0 0 75.3\n100 0.25 -1e-06\n333.33334 1e+06 75\n3 0 1 2\n");
  EXPECT_EQ(MeshFileText(mesh, "obj").value(),
            "# unit: mm, up: z\nv 0 0 75.3\nv 100 0.25 -1e-06\nv 333.33334 1e+06 75\nf 1 2 3\n");
}

TEST_F(MeshFile, WritesNothingThatItCouldNotRead) {
  TriangleMesh mesh;
  EXPECT_THAT(std::string(WriteMeshFile(folder_ / "m.off", mesh).message()), HasSubstr("no triangle"));
  mesh.vertices_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 3}};
  EXPECT_THAT(std::string(WriteMeshFile(folder_ / "m.off", mesh).message()), HasSubstr("uses vertex 3 of 3"));
  mesh.triangles = {{0, 1, 2}};
  EXPECT_THAT(std::string(WriteMeshFile(folder_ / "m.stl", mesh).message()), HasSubstr("known: off, obj"));
  mesh.vertices_m[1].x() = std::nanf("");
  EXPECT_THAT(std::string(WriteMeshFile(folder_ / "m.obj", mesh).message()), HasSubstr("vertex 1"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

}  // namespace
}  // namespace touchstone::geometry
