#include <absl/strings/str_cat.h>

#include <cstring>

#include "server/base/numbers/nan.h"
#include "server/geometry/files/ply.h"

namespace touchstone::geometry::ply {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "BinaryRows swaps for big-endian files only");

class TextRows final : public Rows {
 public:
  TextRows(const MeshReading& reading, const Header& header)
      : reading_(reading), lines_(header.rows, header.lines + 1) {}

  absl::Status BeginRow(const Element& element, uint64_t row) override {
    if (!lines_.NextWithContent('\0'))
      return Error(absl::StrCat("the file ends after ", row, " of ", element.count, " rows of ",
                                Quoted(element.name), "; it is cut off"));
    rest_ = lines_.line();
    return absl::OkStatus();
  }

  absl::Status Number(Type type, const Property& property, double* value) override {
    const absl::string_view word = NextWord(&rest_);
    int64_t whole;
    // What is not finite is refused where it is a place, and passed over where it is a colour or a normal.
    if (!ParseReal(word, value) && IsReal(word)) {
      *value = kNaN;
      return absl::OkStatus();
    }
    if (IsWholeType(type) ? !ParseWhole(word, &whole) : !ParseReal(word, value))
      return Error(absl::StrCat("found ", Quoted(word), " for ", Quoted(property.name),
                                "; the header describes a ", IsWholeType(type) ? "whole" : "finite",
                                " number there"));
    if (IsWholeType(type)) *value = static_cast<double>(whole);
    return absl::OkStatus();
  }

  absl::Status EndRow() override {
    const absl::string_view word = NextWord(&rest_);
    if (word.empty()) return absl::OkStatus();
    return Error(absl::StrCat("found ", Quoted(word),
                              " where the row should end; it has more numbers than the header describes"));
  }

  absl::Status End() override {
    if (!lines_.NextWithContent('\0')) return absl::OkStatus();
    return Error(
        absl::StrCat("found ", Quoted(lines_.line()), " behind the last row; the header's counts are wrong"));
  }

  uint64_t bytes_left() const override { return lines_.bytes_left(); }
  uint64_t bytes_left_in_row() const override { return rest_.size(); }
  uint64_t MinBytes(Type) const override { return 2; }  // a digit and a blank
  uint64_t line() const override { return lines_.number(); }
  absl::Status Error(absl::string_view what) const override {
    return reading_.ErrorAtLine(lines_.number(), what);
  }

 private:
  const MeshReading& reading_;
  LineReader lines_;
  absl::string_view rest_;
};

class BinaryRows final : public Rows {
 public:
  BinaryRows(const MeshReading& reading, const Header& header)
      : reading_(reading), rows_(header.rows), swap_(header.encoding == Encoding::kBigEndian) {
    // A header of \r\n lines or of \n lines ends with just that; the line reader has taken at most one \n too
    // many, where the lines end in \r alone and the first byte of the rows happens to be 10.
    const absl::string_view text = reading.bytes();
    if (text.size() > 4 && text.substr(0, 4) == "ply\r" && text[4] != '\n' && rows_.data() > text.data() &&
        rows_.data()[-1] == '\n')
      rows_ = absl::string_view(rows_.data() - 1, rows_.size() + 1);
  }

  absl::Status BeginRow(const Element& element, uint64_t row) override {
    element_ = &element;
    row_ = row;
    return absl::OkStatus();
  }

  absl::Status Number(Type type, const Property& property, double* value) override {
    const size_t size = kTypeBytes[static_cast<int>(type)];
    if (bytes_left() < size)
      return Error(absl::StrCat("the file ends in row ", row_, " of ", element_->count, " of ",
                                Quoted(element_->name), "; it is cut off"));
    char bytes[8];
    for (size_t b = 0; b < size; ++b) bytes[b] = rows_[at_ + (swap_ ? size - 1 - b : b)];
    at_ += size;
    switch (type) {
      case Type::kInt8:
        *value = As<int8_t>(bytes);
        break;
      case Type::kUint8:
        *value = As<uint8_t>(bytes);
        break;
      case Type::kInt16:
        *value = As<int16_t>(bytes);
        break;
      case Type::kUint16:
        *value = As<uint16_t>(bytes);
        break;
      case Type::kInt32:
        *value = As<int32_t>(bytes);
        break;
      case Type::kUint32:
        *value = As<uint32_t>(bytes);
        break;
      case Type::kFloat:
        *value = As<float>(bytes);
        break;
      case Type::kDouble:
        *value = As<double>(bytes);
        break;
    }
    return absl::OkStatus();
  }

  absl::Status End() override {
    // A closing line break does no harm; anything else means that the counts are wrong.
    for (size_t b = at_; b < rows_.size(); ++b) {
      if (rows_[b] != '\n' && rows_[b] != '\r')
        return Error(absl::StrCat(rows_.size() - at_,
                                  " bytes stand behind the last row; the header's counts are wrong"));
    }
    return absl::OkStatus();
  }

  uint64_t bytes_left() const override { return rows_.size() - at_; }
  uint64_t bytes_left_in_row() const override { return bytes_left(); }
  uint64_t MinBytes(Type type) const override { return kTypeBytes[static_cast<int>(type)]; }
  absl::Status Error(absl::string_view what) const override {
    return reading_.ErrorAtByte(rows_.data() - reading_.bytes().data() + at_, what);
  }

 private:
  template <typename T>
  static T As(const char* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
  }

  const MeshReading& reading_;
  absl::string_view rows_;
  bool swap_;
  size_t at_ = 0;
  const Element* element_ = nullptr;
  uint64_t row_ = 0;
};

}  // namespace

std::unique_ptr<Rows> MakeTextRows(const MeshReading& reading, const Header& header) {
  return std::make_unique<TextRows>(reading, header);
}

std::unique_ptr<Rows> MakeBinaryRows(const MeshReading& reading, const Header& header) {
  return std::make_unique<BinaryRows>(reading, header);
}

}  // namespace touchstone::geometry::ply
