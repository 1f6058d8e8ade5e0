#include "client/report/html_page.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "client/report/words.h"
#include "server/base/printable.h"

namespace touchstone::client {
namespace {

bool IsDigit(char c) {
  return c >= '0' && c <= '9';
}

// A minus sign before a number that stands alone, and powers of ten.
std::string Signs(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const char before = i == 0 ? ' ' : text[i - 1], after = i + 1 < text.size() ? text[i + 1] : ' ';
    if (text[i] == '-' && IsDigit(after) && (before == ' ' || before == '(' || before == '[')) {
      out += "\u2212";
    } else if (text[i] == 'e' && IsDigit(before) && (IsDigit(after) || after == '-')) {
      // "1e-9" is a bare power of ten.
      const bool bare = before == '1' && (i == 1 || text[i - 2] == ' ');
      if (bare) out.pop_back();
      absl::StrAppend(&out, bare ? "" : "\u00d7", "10<sup>", after == '-' ? "\u2212" : "");
      if (after == '-') ++i;
      while (i + 1 < text.size() && IsDigit(text[i + 1])) out += text[++i];
      out += "</sup>";
    } else {
      out += text[i];
    }
  }
  return out;
}

}  // namespace

std::string Escape(absl::string_view text) {
  std::string out;
  for (const char c : Printable(text, std::string::npos, /*keep_lines=*/true)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') out += c;
    }
  }
  return out;
}

std::string Typeset(absl::string_view text) {
  std::string out = Signs(Escape(text));
  if (absl::StartsWith(out, "+- ")) out.replace(0, 3, "\u00b1\u00a0");
  // A number and its unit stay on one line.
  for (const char* unit : {"us", "ms", "s", "mm", "deg", "%", "mm/s", "mm/s2", "1/m"}) {
    const std::string shown =
        absl::StrReplaceAll(unit, {{"us", "\u00b5s"}, {"deg", "\u00b0"}, {"s2", "s\u00b2"}});
    const std::string plain = absl::StrCat(" ", unit),
                      set = absl::StrCat(absl::string_view(unit) == "deg" ? "" : "\u00a0", shown);
    for (size_t at = out.find(plain); at != std::string::npos; at = out.find(plain, at + 1)) {
      const size_t end = at + plain.size();
      const bool whole = end == out.size() || (!std::isalnum(static_cast<unsigned char>(out[end])) &&
                                               out[end] != '_' && out[end] != '/');
      const bool after_number = at > 0 && (IsDigit(out[at - 1]) || out[at - 1] == '>');
      if (whole && after_number) out.replace(at, plain.size(), set);
    }
  }
  return absl::StrReplaceAll(out, {{" +- ", "\u00a0\u00b1\u00a0"},
                                   {"&lt;-&gt;", "\u2194"},
                                   {"-&gt;", "\u2192"},
                                   {"&lt; ", "&lt;\u00a0"}});
}

std::string Section(absl::string_view id, absl::string_view title, absl::string_view lead,
                    absl::string_view body) {
  if (body.empty()) return "";
  return absl::StrCat("<section id=\"", id, "\" aria-labelledby=\"", id, "-title\">\n<h2 id=\"", id,
                      "-title\">", title, "</h2>\n",
                      lead.empty() ? "" : absl::StrCat("<p class=\"about\">", lead, "</p>\n"), body,
                      "</section>\n");
}

std::string PerKind(const v1::Report& report,
                    const std::function<std::string(const v1::DataReport& data)>& part) {
  std::string body;
  for (const v1::DataReport& data : report.data()) {
    const std::string own = part(data);
    if (!own.empty() && report.data_size() > 1)
      absl::StrAppend(&body, "<h3>", KindName(data.kind()), "</h3>\n");
    body += own;
  }
  return body;
}

std::string Figure(absl::string_view picture, absl::string_view caption, absl::string_view css_class) {
  return absl::StrCat("<figure", css_class.empty() ? "" : absl::StrCat(" class=\"", css_class, "\""), ">",
                      picture, caption.empty() ? "" : absl::StrCat("<figcaption>", caption, "</figcaption>"),
                      "</figure>\n");
}

std::string Cell(absl::string_view html, absl::string_view css_class) {
  return absl::StrCat("<td", css_class.empty() ? "" : absl::StrCat(" class=\"", css_class, "\""), ">", html,
                      "</td>");
}

std::string NumberCell(absl::string_view plain) {
  return Cell(Typeset(plain), "num");
}

std::string HeaderRow(const std::vector<std::string>& titles) {
  std::string row = "<thead><tr>";
  for (const std::string& title : titles) {
    const bool number = absl::StartsWith(title, ">");
    absl::StrAppend(&row, "<th scope=\"col\"", number ? " class=\"num\">" : ">", Escape(title.substr(number)),
                    "</th>");
  }
  return row + "</tr></thead>";
}

std::string Bar(double share, absl::string_view css_class, double mark) {
  const double width = std::clamp(std::isnan(share) ? 0 : 100 * share, 0.0, 100.0);
  std::string svg = absl::StrCat("<svg class=\"bar\" aria-hidden=\"true\"><rect class=\"fill ", css_class,
                                 "\" height=\"100%\" width=\"", Fixed(width, 2), "%\"/>");
  if (mark >= 0 && mark <= 1) {
    const std::string x = Fixed(100 * mark, 2);
    absl::StrAppend(&svg, "<line class=\"mark\" x1=\"", x, "%\" x2=\"", x, "%\" y1=\"0\" y2=\"100%\"/>");
  }
  return svg + "</svg>";
}

std::string FingerName(const v1::DataReport& data, int finger) {
  return finger < data.fingers_size() ? data.fingers(finger) : absl::StrCat(finger);
}

std::string Legend(const std::vector<std::pair<std::string, std::string>>& keys) {
  std::string out = "<p class=\"legend\">";
  for (const auto& [css_class, text] : keys) {
    absl::StrAppend(&out, "<span><svg class=\"key\" aria-hidden=\"true\"><rect class=\"", css_class,
                    "\" width=\"100%\" height=\"100%\"/></svg>", Escape(text), "</span>");
  }
  return out + "</p>";
}

}  // namespace touchstone::client
