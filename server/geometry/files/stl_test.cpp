#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

using testing::HasSubstr;
using Triangles = std::vector<std::array<uint32_t, 3>>;

absl::StatusOr<TriangleMesh> ReadStl(const std::string& bytes, std::vector<std::string>* notes = nullptr) {
  return ReadMeshBytes("t.stl", "stl", bytes, MeshImport(), notes);
}

std::string StlRefusal(const std::string& bytes) {
  return std::string(ReadStl(bytes).status().message());
}

std::string Facet(const std::string& a, const std::string& b, const std::string& c) {
  return "facet normal nan 0 -nan(ind)\n outer loop\n  vertex " + a + "\n  vertex " + b + "\n  vertex " + c +
         "\n endloop\nendfacet\n";
}

const std::string kTwo = "solid a facet of a b\n" + Facet("0 0 0", "1 0 0", "1 1 0") +
                         Facet("0 0 -0", "1 1 0", "0 1 0") + "endsolid a facet\n";

// A square of two triangles; `header` fills the 80 bytes.
std::string Binary(const std::string& header, float last = 0) {
  std::string bytes = header;
  bytes.resize(80, '\0');
  bytes += std::string("\x02\0\0\0", 4);
  const auto add = [&](std::initializer_list<float> values) {
    for (float value : values) bytes.append(reinterpret_cast<const char*>(&value), 4);
    bytes += std::string(2, '\x7F');
  };
  add({0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 1, 0});
  add({0, 0, 1, 0, 0, -0.0f, 1, 1, 0, 0, 1, last});
  return bytes;
}

TEST(Stl, TextAndBinaryGiveTheSameSquareOfFourVertices) {
  for (const std::string& bytes :
       {kTwo, Binary(""), Binary("solid facet"), Binary("solid\nfacet normal 0 0 1\n")}) {
    const absl::StatusOr<TriangleMesh> mesh = ReadStl(bytes);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->vertices_m.size(), 4u);
    EXPECT_EQ(mesh->triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(mesh->vertices_m[2], Eigen::Vector3f(1e-3f, 1e-3f, 0));
    EXPECT_FALSE(std::signbit(mesh->vertices_m[0].z()));
  }
}

TEST(Stl, TextMayHoldSeveralSolidsInAnyCase) {
  const absl::StatusOr<TriangleMesh> mesh =
      ReadStl("SOLID\r\n" + Facet("0 0 0", "1 0 0", "0 1 0") + "ENDSOLID\r\n\r\n  Solid B\r\n" +
              Facet("0 0 0", "0 1 0", "0 0 1e0") + "EndSolid B");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), 2u);
  EXPECT_EQ(mesh->vertices_m.size(), 4u);
}

TEST(Stl, SaysWhatIsWrongAndWhereInText) {
  EXPECT_THAT(StlRefusal("solid\nendsolid\n"), HasSubstr("no vertex and no face"));
  EXPECT_THAT(StlRefusal(kTwo.substr(0, kTwo.size() - 20)),
              HasSubstr("line 15: found 'endfac'; expected endfacet"));
  EXPECT_THAT(StlRefusal("solid\n" + Facet("0 0 0", "1 0 0", "0 1 0")), HasSubstr("ends before endsolid"));
  EXPECT_THAT(StlRefusal("solid\n" + Facet("0 0 0", "1 0 zero", "0 1 0")),
              HasSubstr("line 5: found 'zero'; expected a coordinate"));
  EXPECT_THAT(StlRefusal("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\n"),
              HasSubstr("line 6: found 'endloop'; expected vertex"));
  EXPECT_THAT(
      StlRefusal(
          "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\n"),
      HasSubstr("line 7: found 'vertex'; expected endloop"));
  EXPECT_THAT(StlRefusal("solid\nfacet normal 0 0\nouter loop\n"), HasSubstr("three numbers of the normal"));
  EXPECT_THAT(StlRefusal(kTwo.substr(0, kTwo.size() - 26)),
              HasSubstr("ends where endfacet should stand; it is cut off"));
  EXPECT_THAT(StlRefusal("solid\nendsolid\nrubbish\n"), HasSubstr("line 3: found 'rubbish'; expected solid"));
}

TEST(Stl, SaysWhatIsWrongAndWhereInBytes) {
  EXPECT_THAT(StlRefusal(""), HasSubstr("the file is empty"));
  EXPECT_THAT(StlRefusal("hello"), HasSubstr("has 5 bytes"));
  EXPECT_THAT(StlRefusal(Binary("").substr(0, 84 + 99)),
              HasSubstr("byte 80: the header promises 2 triangles, but the bytes "
                        "behind it hold 1"));
  EXPECT_THAT(StlRefusal(Binary("solid").substr(0, 84 + 99)), HasSubstr("byte 80"));
  std::string huge = Binary("");
  huge.replace(80, 4, "\xFF\xFF\xFF\xFF");
  EXPECT_THAT(StlRefusal(huge), HasSubstr("promises 4294967295 triangles"));
  huge.replace(80, 4, std::string(4, '\0'));
  EXPECT_THAT(StlRefusal(huge.substr(0, 84)), HasSubstr("no vertex and no face"));
  EXPECT_THAT(StlRefusal(Binary("", std::numeric_limits<float>::quiet_NaN())),
              HasSubstr("byte 178: triangle 1 has the coordinate nan"));
}

TEST(Stl, TellsOfBytesBehindTheLastTriangle) {
  std::vector<std::string> notes;
  ASSERT_TRUE(ReadStl(Binary("") + "extra", &notes).ok());
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("5 bytes behind the last triangle")));
}

}  // namespace
}  // namespace touchstone::geometry
