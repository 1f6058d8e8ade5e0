// Lines of a terminal: a label column, wrapped text, aligned rows and bars of '#'.
#pragma once

#include <string>
#include <vector>

#include <absl/strings/string_view.h>

namespace touchstone::client {

// How many columns UTF-8 text takes: code points, escapes not counted.
int Columns(absl::string_view text);

class TextLayout {
 public:
  enum Style { kPlain, kBold, kDim, kGood, kBad, kBar };

  TextLayout(int width, bool colour) : width_(width < 60 ? 60 : width), colour_(colour) {}

  int width() const { return width_; }
  // Columns to the right of the labels.
  int room() const { return width_ - kLabel; }

  // Text over the whole width, without a label.
  void Lead(absl::string_view text, Style style = kPlain);
  void Blank() { text_ += '\n'; }
  // Starts a part: the next line carries this label.
  void Label(absl::string_view label) { label_ = std::string(label); }
  // One paragraph beside the label column, wrapped; lines after the first are indented by `hang` more.
  void Paragraph(absl::string_view text, Style style = kPlain, int hang = 0);

  // Lines as they stand (a piece of a model file), never wrapped.
  void Verbatim(absl::string_view text);

  struct Cell {
    std::string text;
    bool right = false;
    Style style = kPlain;
  };
  // Rows with aligned columns, two spaces between them. The last column wraps into what room is left, below
  // the row if it is little; without room for the columns, rows become paragraphs.
  void Rows(const std::vector<std::vector<Cell>>& rows);

  std::string Take() { return std::move(text_); }
  std::string Styled(absl::string_view text, Style style) const;

  static constexpr int kLabel = 12;

 private:
  std::string LabelColumn();  // the pending label, or blanks
  std::vector<std::string> Wrap(absl::string_view text, int first, int rest) const;

  int width_;
  bool colour_;
  std::string label_;
  std::string text_;
};

// `length` of at most `full` columns: in proportion to value / largest, at least one column if value > 0.
int BarLength(double value, double largest, int full);

}  // namespace touchstone::client
