#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

using testing::HasSubstr;
using Triangles = std::vector<std::array<uint32_t, 3>>;

absl::StatusOr<TriangleMesh> ReadObj(const std::string& text, std::vector<std::string>* notes = nullptr) {
  return ReadMeshBytes("t.obj", "obj", text, MeshImport(), notes);
}

std::string ObjRefusal(const std::string& text) {
  return std::string(ReadObj(text).status().message());
}

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(Obj, ReadsAllFormsOfCorners) {
  for (const char* face : {"f 1 2 3", "f 1/9 2/9 3/9", "f 1//9 2//9 3//9", "f 1/9/8 2/9/8 3/9/8",
                           "f 1/ 2/ 3/", "f 1// 2// 3//", "f -4 -3 -2", "f -4/-1/-1 2 3",
                           "  f\t1 2   3  # a comment", "f 1 2 \\\n3", "f 1 \\\r\n 2 \\\r\n 3", "fo 1 2 3"}) {
    const absl::StatusOr<TriangleMesh> mesh = ReadObj(kSquare + face);
    ASSERT_TRUE(mesh.ok()) << face << " " << mesh.status();
    EXPECT_EQ(mesh->triangles, (Triangles{{0, 1, 2}})) << face;
    EXPECT_EQ(mesh->vertices_m[2], Eigen::Vector3f(1e-3f, 1e-3f, 0));
  }
}

// A tetrahedron with edges of 50 along the axes.
const std::string kFourVertices = "v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\n";
const std::string kFourFaces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

TEST(Obj, CommentsAndNamesMayEndInABackslash) {
  for (const std::string& text :
       {"# exported to C:\\parts\\\n" + kFourVertices + kFourFaces, "o part\\\n" + kFourVertices + kFourFaces,
        "mtllib C:\\m\\\r\n" + kFourVertices + kFourFaces, kFourVertices + "# C:\\x\\\n" + kFourFaces,
        kFourVertices + "g a\\\n# c\n" + kFourFaces, kFourVertices + "usemtl steel\\\n" + kFourFaces,
        kFourVertices + "vn 0 0 1\\\n" + kFourFaces,
        kFourVertices + "f 1 3 2 # C:\\\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
        kFourVertices + kFourFaces + "g end\\"}) {
    const absl::StatusOr<TriangleMesh> mesh = ReadObj(text);
    ASSERT_TRUE(mesh.ok()) << text << mesh.status();
    EXPECT_EQ(mesh->vertices_m.size(), 4u) << text;
    EXPECT_EQ(mesh->triangles, (Triangles{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}})) << text;
  }
}

TEST(Obj, NamesAndNumbersThatArePassedOverContinueInTheNextLine) {
  for (const char* continued : {"g one \\\ntwo three\n", "vn 0 0 \\\n1\n", "vn 0 \\\n0 \\\n1\n"}) {
    const absl::StatusOr<TriangleMesh> mesh = ReadObj(kFourVertices + continued + kFourFaces);
    ASSERT_TRUE(mesh.ok()) << continued << mesh.status();
    EXPECT_EQ(mesh->triangles.size(), 4u);
  }
}

TEST(Obj, ColoursMayBeNotANumberButPlacesMayNot) {
  EXPECT_TRUE(ReadObj("v 0 0 0 nan nan nan\nv 50 0 0 -nan(ind) 0 1.#QNAN\nv 0 50 0\nf 1 2 3\n").ok());
  EXPECT_THAT(ObjRefusal("v 0 0 0\nv 50 nan 0\nv 0 50 0\nf 1 2 3\n"), HasSubstr("line 2: found 'nan'"));
}

TEST(Obj, BareCarriageReturnsEndLines) {
  std::string text = "# C:\\parts\\\n" + kFourVertices + kFourFaces;
  std::replace(text.begin(), text.end(), '\n', '\r');
  const absl::StatusOr<TriangleMesh> mesh = ReadObj(text);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), 4u);
}

TEST(Obj, NegativeNumbersCountBackFromTheFace) {
  const absl::StatusOr<TriangleMesh> mesh =
      ReadObj("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -4 -2 -1\n");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Obj, FacesMayStandBeforeTheirVertices) {
  EXPECT_TRUE(ReadObj("f 1 2 3\n" + kSquare).ok());
  EXPECT_THAT(ObjRefusal("f 1 2 5\n" + kSquare),
              HasSubstr("line 1: a face uses vertex 5, but the file has 4 vertices"));
}

TEST(Obj, SplitsPolygonsAndKeepsTheirWinding) {
  const absl::StatusOr<TriangleMesh> mesh = ReadObj(kSquare + "f 4 3 2 1\n");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  ASSERT_EQ(mesh->triangles.size(), 2u);
  for (uint32_t t = 0; t < 2; ++t) {
    const Eigen::Vector3d a = mesh->Corner(t, 0), b = mesh->Corner(t, 1), c = mesh->Corner(t, 2);
    EXPECT_LT((b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x()), 0)
        << "clockwise from above";
  }
}

TEST(Obj, ReadsWeightsColoursGroupsAndMaterials) {
  EXPECT_TRUE(
      ReadObj("mtllib a b.mtl\no x\nv 0 0 0 1\nv 1 0 0 0.1 0.2 0.3\nv +1. .5e+1 -0 1 2 3\nvt 0\nvn 0 0 "
              "1\ng a f 1 2\n"
              "usemtl m\ns off\nl 1 2\np 1\nf 1 2 3\n")
          .ok());
}

TEST(Obj, SaysWhatIsWrongAndWhere) {
  EXPECT_THAT(ObjRefusal(""), HasSubstr("no vertex and no face"));
  EXPECT_THAT(ObjRefusal(kSquare), HasSubstr("4 vertices but no face: points and lines have no surface"));
  EXPECT_THAT(ObjRefusal(kSquare + "l 1 2\n"), HasSubstr("export the object as a surface"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 1 2\n"), HasSubstr("no face with three corners"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 0 1 2\n"), HasSubstr("line 5: a face uses vertex 0; the first vertex"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 1 2 -5\n"),
              HasSubstr("line 5: a face uses vertex -5, but only 4 stand before it"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 1 2 99999999999\n"), HasSubstr("at most"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 1 2 3.5\n"), HasSubstr("found '3.5' as a corner"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 1 2 3/1/1/1\n"), HasSubstr("v/vt/vn"));
  EXPECT_THAT(ObjRefusal(kSquare + "f 1 2 3/x\n"), HasSubstr("found '3/x'"));
  EXPECT_THAT(ObjRefusal("v 0 0\n"), HasSubstr("line 1: found nothing as the vertex's z"));
  EXPECT_THAT(ObjRefusal("v 0 0 3.1+e2\n"), HasSubstr("'3.1+e2'"));
  EXPECT_THAT(ObjRefusal("v 0 0 0 red\n"), HasSubstr("'red'"));
  EXPECT_THAT(ObjRefusal("\n\nvv 0 0 0\n"), HasSubstr("line 3: found 'vv', which is no statement of OBJ"));
  EXPECT_THAT(ObjRefusal(std::string("\x89PNG\r\n\x1A\n\0", 9)), HasSubstr("'\\x89PNG'"));
}

TEST(Obj, TellsOfFreeFormSurfacesOnce) {
  std::vector<std::string> notes;
  ASSERT_TRUE(ReadObj(kSquare + "f 1 2 3\ncstype bezier\ndeg 3\ncurv 0 1 1 2\nend\n", &notes).ok());
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], HasSubstr("t.obj: line 6: free-form"));
}

}  // namespace
}  // namespace touchstone::geometry
