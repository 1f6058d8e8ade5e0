#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/geometry/files/ply.h"

namespace touchstone::geometry::ply {
namespace {

bool TypeFromName(absl::string_view name, Type* type) {
  static constexpr absl::string_view kNames[][2] = {
      {"char", "int8"}, {"uchar", "uint8"}, {"short", "int16"},   {"ushort", "uint16"},
      {"int", "int32"}, {"uint", "uint32"}, {"float", "float32"}, {"double", "float64"}};
  for (int t = 0; t < 8; ++t) {
    if (name != kNames[t][0] && name != kNames[t][1]) continue;
    *type = static_cast<Type>(t);
    return true;
  }
  return false;
}

class HeaderReader {
 public:
  explicit HeaderReader(const MeshReading& reading) : reading_(reading), lines_(reading.bytes()) {}

  absl::StatusOr<Header> Read() {
    if (reading_.bytes().empty())
      return reading_.Error("the file is empty; a PLY file begins with the word ply");
    lines_.Next();
    absl::string_view line = lines_.line();
    if (NextWord(&line) != "ply")
      return Error(absl::StrCat("found ", Quoted(lines_.line()), "; a PLY file begins with the word ply"));
    bool has_format = false;
    while (lines_.Next()) {
      line = lines_.line();
      const absl::string_view keyword = NextWord(&line);
      if (keyword == "end_header") {
        if (!has_format)
          return Error("the header has no format line; expected format ascii 1.0, or a binary one");
        header_.lines = lines_.number();
        header_.rows = lines_.rest();
        return header_;
      }
      if (keyword == "format") {
        TOUCHSTONE_RETURN_IF_ERROR(ReadFormat(line));
        has_format = true;
      } else if (keyword == "element") {
        TOUCHSTONE_RETURN_IF_ERROR(ReadElement(line));
      } else if (keyword == "property") {
        TOUCHSTONE_RETURN_IF_ERROR(ReadProperty(line));
      } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
        return Error(absl::StrCat("found ", Quoted(keyword),
                                  " in the header; expected format, comment, obj_info, "
                                  "element, property or end_header"));
      }
    }
    return Error("the header has no end_header; the file is cut off, or is no PLY");
  }

 private:
  absl::Status Error(absl::string_view what) const { return reading_.ErrorAtLine(lines_.number(), what); }

  absl::Status ReadFormat(absl::string_view line) {
    const absl::string_view name = NextWord(&line), version = NextWord(&line);
    if (name == "ascii") {
      header_.encoding = Encoding::kText;
    } else if (name == "binary_little_endian") {
      header_.encoding = Encoding::kLittleEndian;
    } else if (name == "binary_big_endian") {
      header_.encoding = Encoding::kBigEndian;
    } else {
      return Error(absl::StrCat("found the format ", Quoted(name),
                                "; expected ascii, binary_little_endian or binary_big_endian"));
    }
    if (version != "1.0") return Error(absl::StrCat("found the version ", Quoted(version), "; expected 1.0"));
    return absl::OkStatus();
  }

  absl::Status ReadElement(absl::string_view line) {
    Element element;
    element.name = std::string(NextWord(&line));
    element.line = lines_.number();
    const absl::string_view word = NextWord(&line);
    int64_t count;
    if (element.name.empty() || !ParseWhole(word, &count) || count < 0)
      return Error(absl::StrCat("found ", Quoted(word), " as the number of rows of element ",
                                Quoted(element.name), "; expected: element NAME COUNT"));
    for (const Element& other : header_.elements)
      if (other.name == element.name)
        return Error(absl::StrCat("the element ", Quoted(element.name), " stands twice"));
    if (header_.elements.size() >= 100) return Error("more than 100 elements");
    element.count = static_cast<uint64_t>(count);
    header_.elements.push_back(std::move(element));
    return absl::OkStatus();
  }

  absl::Status ReadProperty(absl::string_view line) {
    if (header_.elements.empty()) return Error("a property before the first element; expected element first");
    Element& element = header_.elements.back();
    Property property;
    absl::string_view type = NextWord(&line);
    property.is_list = type == "list";
    if (property.is_list) {
      const absl::string_view count_type = NextWord(&line);
      if (!TypeFromName(count_type, &property.count_type) || !IsWholeType(property.count_type))
        return Error(absl::StrCat("found ", Quoted(count_type),
                                  " as the type of a list's length; expected a whole-"
                                  "number type such as uchar"));
      type = NextWord(&line);
    }
    if (!TypeFromName(type, &property.type))
      return Error(absl::StrCat("found the type ", Quoted(type),
                                "; expected char, uchar, short, ushort, int, uint, "
                                "float, double, or int8 to float64"));
    property.name = std::string(NextWord(&line));
    if (property.name.empty()) return Error("a property without a name");
    if (element.Find(property.name) >= 0)
      return Error(
          absl::StrCat("the property ", Quoted(property.name), " stands twice in ", Quoted(element.name)));
    if (element.properties.size() >= 1000) return Error("more than 1000 properties of an element");
    element.properties.push_back(std::move(property));
    return absl::OkStatus();
  }

  const MeshReading& reading_;
  LineReader lines_;
  Header header_;
};

}  // namespace

absl::StatusOr<Header> ReadHeader(const MeshReading& reading) {
  return HeaderReader(reading).Read();
}

}  // namespace touchstone::geometry::ply
