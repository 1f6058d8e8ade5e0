#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

using testing::HasSubstr;
using Triangles = std::vector<std::array<uint32_t, 3>>;

absl::StatusOr<TriangleMesh> Read(const std::string& bytes) {
  return ReadMeshBytes("t.ply", "ply", bytes);
}
std::string Refusal(const std::string& bytes) {
  return std::string(Read(bytes).status().message());
}

const std::string kVertex = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
const std::string kFace = "element face 1\nproperty list uchar int vertex_indices\n";

std::string Text(const std::string& elements, const std::string& rows) {
  return "ply\nformat ascii 1.0\n" + elements + "end_header\n" + rows;
}

TEST(Ply, MarksWhereFilesWerePutTogetherArePassedOver) {
  const std::string rows = "0 0 0\n50 0 0\n0 50 0\n0 0 50\n3 0 2 1\n";
  for (const char* end : {"\n", "\r", "\r\n"}) {
    const std::string text = absl::StrReplaceAll(Text(kVertex + kFace, "\xEF\xBB\xBF" + rows), {{"\n", end}});
    const auto mesh = Read(text);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->triangles, (Triangles{{0, 2, 1}}));
  }
}

TEST(Ply, ColoursMayBeNotANumberButPlacesMayNot) {
  const std::string elements =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float red\nproperty "
      "uchar "
      "green\n" +
      kFace;
  EXPECT_TRUE(Read(Text(elements, "0 0 0 nan 1\n50 0 0 -nan nan\n0 50 0 inf 3\n3 0 1 2\n")).ok())
      << Refusal(Text(elements, "0 0 0 nan 1\n50 0 0 -nan nan\n0 50 0 inf 3\n3 0 1 2\n"));
  EXPECT_THAT(Refusal(Text(elements, "0 0 nan 0 1\n50 0 0 0 2\n0 50 0 0 3\n3 0 1 2\n")),
              HasSubstr("the coordinate nan; only finite numbers are places"));
  EXPECT_THAT(Refusal(Text(elements, "0 0 0 0 1\n50 0 0 0 2\n0 50 0 0 3\n3 0 1 nan\n")),
              HasSubstr("face 0 uses vertex nan"));
}

// Appends numbers of any type in either byte order.
class Bytes {
 public:
  explicit Bytes(bool big_endian) : big_endian_(big_endian) {}
  template <typename T>
  Bytes& Add(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof value);
    if (big_endian_) std::reverse(bytes, bytes + sizeof value);
    text_.append(bytes, sizeof value);
    return *this;
  }
  const std::string& text() const { return text_; }

 private:
  bool big_endian_;
  std::string text_;
};

// A square with every type of number, the faces first, an unknown element between and lists that do not
// matter.
std::string EveryType(bool big_endian, const std::string& line_break) {
  std::string header = absl::StrCat("ply\nformat binary_", big_endian ? "big" : "little",
                                    "_endian 1.0\ncomment a b\nobj_info c\n"
                                    "element face 1\nproperty list ushort double weights\nproperty list "
                                    "int16 uint32 vertex_index\nproperty char q\n"
                                    "element material 2\nproperty uint8 r\nproperty list uint int8 name\n"
                                    "element vertex 4\nproperty short z\nproperty double x\nproperty uint16 "
                                    "w\nproperty float32 y\nproperty int i\n"
                                    "end_header\n");
  std::string with_breaks;
  for (char c : header) c == '\n' ? with_breaks += line_break : with_breaks += c;
  Bytes rows(big_endian);
  rows.Add<uint16_t>(2).Add<double>(0.5).Add<double>(0.25);
  rows.Add<int16_t>(4).Add<uint32_t>(0).Add<uint32_t>(1).Add<uint32_t>(2).Add<uint32_t>(3).Add<int8_t>(-1);
  rows.Add<uint8_t>(1).Add<uint32_t>(0).Add<uint8_t>(2).Add<uint32_t>(1).Add<int8_t>('\n');
  for (int v = 0; v < 4; ++v)
    rows.Add<int16_t>(-300)
        .Add<double>(v == 1 || v == 2)
        .Add<uint16_t>(60000)
        .Add<float>(v >= 2)
        .Add<int32_t>(-7);
  return with_breaks + rows.text();
}

TEST(Ply, ReadsEveryTypeInBothByteOrdersBehindEveryLineBreak) {
  for (bool big_endian : {false, true})
    for (const char* line_break : {"\n", "\r\n", "\r"}) {
      const absl::StatusOr<TriangleMesh> mesh = Read(EveryType(big_endian, line_break));
      ASSERT_TRUE(mesh.ok()) << mesh.status();
      EXPECT_EQ(mesh->triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
      EXPECT_EQ(mesh->vertices_m[2], Eigen::Vector3f(1e-3f, 1e-3f, -0.3f));
    }
}

TEST(Ply, RowsMayBeginWithTheByteOfALineBreak) {
  // Behind a header of \r lines the first byte, a list's length of 10, is no part of the header.
  std::string bytes =
      "ply\rformat binary_little_endian 1.0\relement skip 1\rproperty list uchar uchar l\relement vertex 3\r"
      "property float x\rproperty float y\rproperty float z\relement face 1\rproperty list uchar uchar "
      "vertex_index\r"
      "end_header\r";
  Bytes rows(false);
  rows.Add<uint8_t>(10);
  for (int i = 0; i < 10; ++i) rows.Add<uint8_t>(0);
  for (float value : {0, 0, 0, 1, 0, 0, 0, 1, 0}) rows.Add<float>(value);
  rows.Add<uint8_t>(3).Add<uint8_t>(0).Add<uint8_t>(1).Add<uint8_t>(2);
  const absl::StatusOr<TriangleMesh> mesh = Read(bytes + rows.text());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles, (Triangles{{0, 1, 2}}));
}

TEST(Ply, ReadsTextWithFurtherPropertiesAndElements) {
  const absl::StatusOr<TriangleMesh> mesh =
      Read(Text("element edge 1\nproperty int a\n" + kFace + "property uchar red\n" + kVertex +
                    "property uchar alpha\n",
                "7\n4 0 1 2 3 255\n\n0 0 0 1\n1 0 0 1\r\n1 1 0 1\n0 1 0 1"));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Ply, SaysWhatIsWrongInTheHeader) {
  EXPECT_THAT(Refusal(""), HasSubstr("the file is empty"));
  EXPECT_THAT(Refusal("OFF\n"), HasSubstr("begins with the word ply"));
  EXPECT_THAT(Refusal("ply\nformat binary_little_endian 1.0\nelement vertex 3\n"),
              HasSubstr("no end_header"));
  EXPECT_THAT(Refusal("ply\nend_header\n"), HasSubstr("no format line"));
  EXPECT_THAT(Refusal("ply\nformat binary 1.0\n"), HasSubstr("line 2: found the format 'binary'"));
  EXPECT_THAT(Refusal("ply\nformat ascii 2.0\n"), HasSubstr("expected 1.0"));
  EXPECT_THAT(Refusal("ply\nformat ascii 1.0\nproperty int x\n"), HasSubstr("before the first element"));
  EXPECT_THAT(Refusal("ply\nformat ascii 1.0\nelement vertex many\n"),
              HasSubstr("found 'many' as the number of rows"));
  EXPECT_THAT(Refusal(Text("element vertex 1\nproperty half x\n", "")), HasSubstr("found the type 'half'"));
  EXPECT_THAT(Refusal(Text("element vertex 1\nproperty list float int x\n", "")),
              HasSubstr("type of a list's length"));
  EXPECT_THAT(Refusal(Text("element vertex 1\nproperty int x\nproperty int x\n", "")),
              HasSubstr("stands twice"));
  EXPECT_THAT(Refusal(Text("elment vertex 1\n", "")), HasSubstr("line 3: found 'elment' in the header"));
  EXPECT_THAT(Refusal(Text("element vertex 1\nproperty float x\nproperty float y\n", "0 0\n")),
              HasSubstr("lacks the property z"));
  EXPECT_THAT(Refusal(Text(kVertex + "element face 1\nproperty list uchar int corners\n",
                           "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n")),
              HasSubstr("lacks a list of whole numbers called vertex_indices"));
  EXPECT_THAT(Refusal(Text("element nothing 1000000000000\n" + kVertex, "0 0 0\n")),
              HasSubstr("has rows but no property"));
}

TEST(Ply, SaysWhatIsWrongInTheRows) {
  const std::string elements = kVertex + kFace, square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  EXPECT_THAT(Refusal(Text(elements, square)), HasSubstr("cannot hold"));
  EXPECT_THAT(Refusal(Text(elements, "0 0 0.000\n1 0 0\n1 1 0\n\n\n\n\n\n\n\n\n\n\n")),
              HasSubstr("ends after 3 of 4 rows"));
  EXPECT_THAT(Refusal(Text(elements, "0 0 0\n1 0\n1 1 0\n0 1 0\n3 0 1 2\n")),
              HasSubstr("line 11: found nothing for 'z'"));
  EXPECT_THAT(Refusal(Text(elements, square + "3 0 1 2 6 0.5\n")),
              HasSubstr("line 14: found '6' where the row should end"));
  EXPECT_THAT(Refusal(Text(elements, square + "3 0 1 2.5\n")), HasSubstr("found '2.5' for 'vertex_indices'"));
  EXPECT_THAT(Refusal(Text(elements, square + "3 0 1 4\n")),
              HasSubstr("face 0 uses vertex 4, but the file has 4 vertices, 0 to 3"));
  EXPECT_THAT(Refusal(Text(elements, square + "3 0 1 -1\n")), HasSubstr("face 0 uses vertex -1"));
  EXPECT_THAT(Refusal(Text(elements, square + "2000000000 0 1 2\n")), HasSubstr("which do not stand there"));
  EXPECT_THAT(Refusal(Text(elements, square + "3 0 1 2\n3 0 1 2\n")), HasSubstr("behind the last row"));
  EXPECT_THAT(Refusal(Text(kVertex, square)), HasSubstr("no face"));
  EXPECT_THAT(Refusal(Text("element tristrips 1\nproperty list int int vertex_indices\n" + kVertex,
                           "3 0 1 2\n" + square)),
              HasSubstr("triangle strips are not read"));
}

TEST(Ply, BelievesNoCountThatTheBytesCannotHold) {
  for (const char* format : {"ascii", "binary_little_endian"})
    for (const char* count : {"1000000000000", "4294967296", "9223372036854775807"})
      EXPECT_THAT(Refusal(absl::StrCat(
                      "ply\nformat ", format, " 1.0\nelement vertex ", count,
                      "\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n")),
                  HasSubstr(absl::StrCat("line 3: the header promises ", count, " rows of 'vertex'")));
}

TEST(Ply, CutOffBytesAreRefusedAtEveryPlace) {
  const std::string whole = EveryType(true, "\n");
  for (size_t size = 0; size < whole.size(); ++size) ASSERT_FALSE(Read(whole.substr(0, size)).ok()) << size;
  EXPECT_TRUE(Read(whole + "\n").ok());
  EXPECT_THAT(Refusal(whole + "more"), HasSubstr("4 bytes stand behind the last row"));
}

}  // namespace
}  // namespace touchstone::geometry
