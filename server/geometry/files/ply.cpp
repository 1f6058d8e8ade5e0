// PLY, the polygon format of Stanford: a text header that describes rows, then the rows, as text or binary.
//   element vertex N    property TYPE x ...       in any order, with any further properties and elements
//   element face N      property list TYPE TYPE vertex_indices ...
// http://paulbourke.net/dataformats/ply/
// Here rows become a mesh; ply_header.cpp reads the header, ply_rows.cpp the numbers.
#include "server/geometry/files/ply.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::geometry {
namespace ply {
namespace {

class BodyReader {
 public:
  BodyReader(const Header& header, Rows* rows, MeshReading* reading)
      : header_(header), rows_(*rows), reading_(*reading) {}

  absl::Status Read() {
    for (const Element& element : header_.elements) {
      TOUCHSTONE_RETURN_IF_ERROR(CheckElement(element));
      TOUCHSTONE_RETURN_IF_ERROR(ReadElement(element));
    }
    TOUCHSTONE_RETURN_IF_ERROR(rows_.End());
    const uint64_t vertices = reading_.mesh().points.size();
    if (highest_ >= vertices && !reading_.mesh().corners.empty())
      return reading_.ErrorAtLine(
          highest_line_,
          absl::StrCat("face ", highest_face_, " uses vertex ", highest_, ", but the file has ", vertices,
                       " vertices, 0 to ", static_cast<int64_t>(vertices) - 1));
    return absl::OkStatus();
  }

 private:
  // Refuses elements that cannot be right before anything is read or allocated for them.
  absl::Status CheckElement(const Element& element) {
    uint64_t min_bytes = 0;
    for (const Property& property : element.properties)
      min_bytes += rows_.MinBytes(property.is_list ? property.count_type : property.type);
    if (min_bytes == 0 && element.count > 0)
      return reading_.ErrorAtLine(
          element.line, absl::StrCat("the element ", Quoted(element.name), " has rows but no property"));
    TOUCHSTONE_RETURN_IF_ERROR(reading_.CheckCount(element.line,
                                                   absl::StrCat("rows of ", Quoted(element.name)),
                                                   element.count, min_bytes, rows_.bytes_left()));
    list_ = -1;
    for (int& at : xyz_) at = -1;
    if (element.name == "vertex") {
      TOUCHSTONE_RETURN_IF_ERROR(reading_.CheckVertexCount(element.line, element.count));
      for (int k = 0; k < 3; ++k) {
        xyz_[k] = element.Find(absl::string_view("xyz").substr(k, 1));
        if (element.count > 0 && (xyz_[k] < 0 || element.properties[xyz_[k]].is_list))
          return reading_.ErrorAtLine(element.line, absl::StrCat("the element vertex lacks the property ",
                                                                 absl::string_view("xyz").substr(k, 1)));
      }
      reading_.mesh().points.reserve(element.count);
    } else if (element.name == "face") {
      list_ = std::max(element.Find("vertex_indices"), element.Find("vertex_index"));
      if (element.count > 0 &&
          (list_ < 0 || !element.properties[list_].is_list || !IsWholeType(element.properties[list_].type)))
        return reading_.ErrorAtLine(element.line,
                                    "the element face lacks a list of whole numbers called "
                                    "vertex_indices (or vertex_index)");
      reading_.mesh().sizes.reserve(element.count);
    } else if (element.name == "tristrips" && element.count > 0) {
      return reading_.ErrorAtLine(element.line, "triangle strips are not read; save the mesh with faces");
    }
    return absl::OkStatus();
  }

  absl::Status ReadElement(const Element& element) {
    const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
    for (uint64_t row = 0; row < element.count; ++row) {
      TOUCHSTONE_RETURN_IF_ERROR(rows_.BeginRow(element, row));
      double point[3] = {};
      for (int p = 0; p < static_cast<int>(element.properties.size()); ++p) {
        const Property& property = element.properties[p];
        if (property.is_list) {
          TOUCHSTONE_RETURN_IF_ERROR(ReadList(property, row, is_face && p == list_));
          continue;
        }
        double value;
        TOUCHSTONE_RETURN_IF_ERROR(rows_.Number(property.type, property, &value));
        for (int k = 0; k < 3; ++k)
          if (p == xyz_[k]) point[k] = value;
      }
      TOUCHSTONE_RETURN_IF_ERROR(rows_.EndRow());
      if (is_vertex) TOUCHSTONE_RETURN_IF_ERROR(reading_.AddPoint(point, rows_.line()));
      if (is_face) TOUCHSTONE_RETURN_IF_ERROR(reading_.AddFace(corners_, rows_.line()));
    }
    return absl::OkStatus();
  }

  absl::Status ReadList(const Property& property, uint64_t row, bool is_corners) {
    double length;
    TOUCHSTONE_RETURN_IF_ERROR(rows_.Number(property.count_type, property, &length));
    if (!(length >= 0) ||
        length > static_cast<double>(rows_.bytes_left_in_row() / rows_.MinBytes(property.type)))
      return rows_.Error(absl::StrCat("row ", row, " has a list ", Quoted(property.name), " of ", length,
                                      " entries, which do not stand there"));
    if (is_corners) corners_.clear();
    for (uint64_t i = 0; i < static_cast<uint64_t>(length); ++i) {
      double value;
      TOUCHSTONE_RETURN_IF_ERROR(rows_.Number(property.type, property, &value));
      if (!is_corners) continue;
      if (!(value >= 0 && value < static_cast<double>(reading_.limits().max_vertices)))
        return rows_.Error(absl::StrCat("face ", row, " uses vertex ", ShortestNumber(value),
                                        "; expected the number of a vertex, from 0 on"));
      corners_.push_back(static_cast<uint32_t>(value));
      if (corners_.back() > highest_) {
        highest_ = corners_.back();
        highest_face_ = row;
        highest_line_ = rows_.line();
      }
    }
    return absl::OkStatus();
  }

  const Header& header_;
  Rows& rows_;
  MeshReading& reading_;
  int xyz_[3] = {-1, -1, -1};
  int list_ = -1;
  std::vector<uint32_t> corners_;
  uint64_t highest_ = 0;  // vertex that a face uses
  uint64_t highest_face_ = 0;
  uint64_t highest_line_ = 0;
};

}  // namespace
}  // namespace ply

bool LooksLikePly(absl::string_view bytes) {
  LineReader lines(bytes);
  if (!lines.Next()) return false;
  absl::string_view line = lines.line();
  return NextWord(&line) == "ply";
}

absl::Status ReadPly(MeshReading* reading) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const ply::Header header, ply::ReadHeader(*reading));
  const std::unique_ptr<ply::Rows> rows = header.encoding == ply::Encoding::kText
                                              ? ply::MakeTextRows(*reading, header)
                                              : ply::MakeBinaryRows(*reading, header);
  return ply::BodyReader(header, rows.get(), reading).Read();
}

}  // namespace touchstone::geometry
