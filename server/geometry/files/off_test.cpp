#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

using testing::HasSubstr;

absl::StatusOr<TriangleMesh> Read(const std::string& text, std::vector<std::string>* notes = nullptr) {
  return ReadMeshBytes("t.off", "off", text, MeshImport(), notes);
}

std::string Refusal(const std::string& text) {
  return std::string(Read(text).status().message());
}

const char kTriangle[] = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

TEST(Off, ReadsAllFormsOfTheHeader) {
  for (const char* header :
       {"OFF\n3 1 0\n", "OFF\n3 1\n", "OFF 3 1 0\n", "OFF3 1 0\n", "# c\nOFF # d\n\n# e\n3 1 0 # f\n",
        "\xEF\xBB\xBFOFF\n3 1 0\n", "OFF\r\n3 1 0\r\n", "OFF\r3 1 0\r", "COFF\n3 1 0\n"}) {
    const absl::StatusOr<TriangleMesh> mesh = Read(std::string(header) + kTriangle);
    ASSERT_TRUE(mesh.ok()) << header << mesh.status();
    EXPECT_EQ(mesh->vertices_m[1], Eigen::Vector3f(1e-3f, 0, 0));
    EXPECT_EQ(mesh->triangles, (std::vector<std::array<uint32_t, 3>>{{0, 1, 2}}));
  }
}

TEST(Off, PassesOverColoursAndNormals) {
  const absl::StatusOr<TriangleMesh> mesh = Read(
      "STCNOFF\n3 2 0\n0 0 0 0 0 1 255 0 0 255 0.5 0.5\n1 0 0 0 0 1 1 0 0 1 0 0\n0 1 0 0 0 1 1 0 0 1 0 0\n"
      "3 0 1 2 0.1 0.2 0.3\n3 0 2 1 7 # colour map\n");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), 2u);
}

TEST(Off, SaysWhatIsWrongAndWhere) {
  const std::string head = "OFF\n3 1 0\n";
  EXPECT_THAT(Refusal(""), HasSubstr("t.off: the file is empty"));
  EXPECT_THAT(Refusal("PLY\n"), HasSubstr("line 1: found 'PLY'; an OFF file begins with the word OFF"));
  EXPECT_THAT(Refusal("4OFF\n"), HasSubstr("4OFF"));
  EXPECT_THAT(Refusal("OFF BINARY\n"), HasSubstr("binary OFF is not read"));
  EXPECT_THAT(Refusal("OFF\n"), HasSubstr("ends before the counts"));
  EXPECT_THAT(Refusal("OFF\n3 x\n"), HasSubstr("line 2: found 'x' as the number of faces"));
  EXPECT_THAT(Refusal("OFF\n-3 1 0\n"), HasSubstr("'-3'"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n"),
              HasSubstr("line 4: found nothing as the vertex's z"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1 0,5 0\n0 1 0\n3 0 1 2\n"),
              HasSubstr("line 4: found '0,5' as the vertex's y"));
  EXPECT_THAT(Refusal(head + "0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"), HasSubstr("finite"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1e999 0 0\n0 1 0\n3 0 1 2\n"), HasSubstr("'1e999'"));
  EXPECT_THAT(
      Refusal(head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
      HasSubstr("line 6: found '3' as corner 2 of 3 of face 0; expected the number of a vertex, 0 to 2"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n"), HasSubstr("found nothing as corner 2 of 3"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n"), HasSubstr("'-2'"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n"), HasSubstr("corner 3 of 4000000000"));
  EXPECT_THAT(Refusal(head + "0 0 0\n1 0 0\n   \n# nothing more"), HasSubstr("ends after 2 of 3 vertices"));
  EXPECT_THAT(Refusal(head + kTriangle + "3 0 2 1\n"), HasSubstr("behind the last of 1 faces"));
  EXPECT_THAT(Refusal("OFF\n2 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
              HasSubstr("line 6: found '2' as corner 2 of 3 of face 1"));
  EXPECT_THAT(Refusal("OFF\n4 1 0\n" + std::string(kTriangle)), HasSubstr("four numbers"));
}

TEST(Off, BelievesNoCountThatTheBytesCannotHold) {
  EXPECT_THAT(Refusal("OFF\n1000000000000 1 0\n0 0 0\n"),
              HasSubstr("line 2: the header promises 1000000000000 vertices, but the 6 bytes that follow"));
  EXPECT_THAT(Refusal("OFF\n3 9000000000 0\n" + std::string(kTriangle)), HasSubstr("9000000000 faces"));
}

TEST(Off, TellsWhatItPassesOver) {
  std::vector<std::string> notes;
  ASSERT_TRUE(Read("OFF\n3 3 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n3 0 1 2\n1 0\n<project>\n", &notes).ok());
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_THAT(notes[0],
              HasSubstr("t.off: line 9: passed over what stands behind the last face: '<project>'"));
  EXPECT_THAT(notes[1], HasSubstr("t.off: line 6: 2 faces have fewer than three corners"));
}

}  // namespace
}  // namespace touchstone::geometry
