#include "client/report/svg_chart.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

// Pixels with one decimal, without a trailing ".0".
std::string Px(double value) {
  std::string text = Fixed(value, 1);
  if (text.size() > 2 && text.compare(text.size() - 2, 2, ".0") == 0) text.resize(text.size() - 2);
  return text;
}

}  // namespace

void RangeFinder::Add(double value) {
  if (!std::isfinite(value)) return;
  low_ = any_ ? std::min(low_, value) : value;
  high_ = any_ ? std::max(high_, value) : value;
  any_ = true;
}

Range RangeFinder::Get(double margin) const {
  if (!any_) return {};
  double span = high_ - low_;
  if (!(span > 0))
    return {low_ - std::max(1e-9, std::abs(low_) * 0.5), high_ + std::max(1e-9, std::abs(high_) * 0.5)};
  return {low_ - margin * span, high_ + margin * span};
}

std::vector<double> Ticks(Range range, int count) {
  const double span = range.high - range.low;
  if (!(span > 0) || !std::isfinite(span) || count < 1) return {};
  double step = std::pow(10.0, std::floor(std::log10(span / count)));
  while (span / step > count) {
    step *= span / (2 * step) <= count ? 2 : span / (5 * step) <= count ? 5 : 10;
  }
  std::vector<double> ticks;
  for (double k = std::ceil(range.low / step - 1e-9); k * step <= range.high + 1e-9 * span; ++k) {
    ticks.push_back(k == 0 ? 0.0 : k * step);  // not -0
  }
  return ticks;
}

Chart::Chart(double width, double height, std::string title, Axis x, Axis y)
    : width_(width),
      height_(height),
      left_(44),
      right_(width - 22),
      top_(title.empty() ? 24 : 44),
      bottom_(height - 36),
      title_(std::move(title)),
      x_(std::move(x)),
      y_(std::move(y)) {}

std::string Chart::X(double x) const {
  const double share = (x - x_.range.low) / (x_.range.high - x_.range.low);
  return Px(left_ + (right_ - left_) * std::clamp(share, -0.02, 1.02));
}

std::string Chart::Y(double y) const {
  const double share = (y - y_.range.low) / (y_.range.high - y_.range.low);
  return Px(bottom_ - (bottom_ - top_) * std::clamp(share, -0.02, 1.02));
}

void Chart::Line(const std::vector<ChartPoint>& points, const std::string& css_class) {
  std::string path;
  bool on = false;
  for (const ChartPoint& p : points) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y)) {
      on = false;
      continue;
    }
    absl::StrAppend(&path, on ? "L" : "M", X(p.x), " ", Y(p.y));
    on = true;
  }
  absl::StrAppend(&marks_, "<path class=\"line ", css_class, "\" d=\"", path, "\"/>");
}

void Chart::Dots(const std::vector<ChartPoint>& points, const std::string& css_class) {
  std::string path;
  for (const ChartPoint& p : points) {
    if (std::isfinite(p.x) && std::isfinite(p.y)) absl::StrAppend(&path, "M", X(p.x), " ", Y(p.y), "h0");
  }
  absl::StrAppend(&marks_, "<path class=\"dots ", css_class, "\" d=\"", path, "\"/>");
}

void Chart::Whiskers(const std::vector<ChartPoint>& points, const std::vector<double>& sizes,
                     const std::string& css_class) {
  std::string path;
  for (size_t i = 0; i < points.size() && i < sizes.size(); ++i) {
    if (!std::isfinite(points[i].y) || !(sizes[i] > 0) || !std::isfinite(sizes[i])) continue;
    absl::StrAppend(&path, "M", X(points[i].x), " ", Y(points[i].y - sizes[i]), "V",
                    Y(points[i].y + sizes[i]));
  }
  absl::StrAppend(&marks_, "<path class=\"whisker ", css_class, "\" d=\"", path, "\"/>");
}

void Chart::Steps(const std::vector<double>& edges, const std::vector<double>& heights,
                  const std::string& css_class) {
  if (edges.size() < 2 || heights.size() + 1 != edges.size()) return;
  std::string path = absl::StrCat("M", X(edges[0]), " ", Y(0));
  for (size_t i = 0; i < heights.size(); ++i) {
    absl::StrAppend(&path, "V", Y(std::isfinite(heights[i]) ? heights[i] : 0), "H", X(edges[i + 1]));
  }
  absl::StrAppend(&marks_, "<path class=\"", css_class, "\" d=\"", path, "V", Y(0), "\"/>");
}

void Chart::ZeroLine() {
  if (y_.range.low > 0 || y_.range.high < 0) return;
  absl::StrAppend(&marks_, "<path class=\"zero\" d=\"M", Px(left_), " ", Y(0), "H", Px(right_), "\"/>");
}

void Chart::Label(ChartPoint at, const std::string& text, const std::string& css_class) {
  const std::string y = Px(std::atof(Y(at.y).c_str()) + 4);
  absl::StrAppend(&marks_, "<text class=\"", css_class, "\" x=\"", Px(std::atof(X(at.x).c_str()) + 6),
                  "\" y=\"", y, "\">", Escape(text), "</text>");
}

std::string Chart::Frame() const {
  std::string out, grid;
  if (!title_.empty())
    absl::StrAppend(&out, "<text class=\"title\" x=\"0\" y=\"14\">", Typeset(title_), "</text>");
  absl::StrAppend(&out, "<text x=\"0\" y=\"", Px(top_ - 10), "\">", Typeset(y_.title), "</text>");
  for (const double tick : Ticks(y_.range, 5)) {
    const std::string y = Y(tick);
    absl::StrAppend(&grid, "M", Px(left_), " ", y, "H", Px(right_));
    absl::StrAppend(&out, "<text text-anchor=\"end\" x=\"", Px(left_ - 6), "\" y=\"",
                    Px(std::atof(y.c_str()) + 4), "\">", Typeset(Tick(tick)), "</text>");
  }
  for (const double tick : Ticks(x_.range, 5)) {
    absl::StrAppend(&out, "<text text-anchor=\"middle\" x=\"", X(tick), "\" y=\"", Px(bottom_ + 15), "\">",
                    Typeset(Tick(tick)), "</text>");
  }
  absl::StrAppend(&out, "<text text-anchor=\"end\" x=\"", Px(right_), "\" y=\"", Px(bottom_ + 31), "\">",
                  Typeset(x_.title), "</text><path class=\"axis\" d=\"", grid, "\"/>");
  return out;
}

std::string Chart::Svg(const std::string& description) const {
  return absl::StrCat("<svg class=\"chart\" style=\"max-width:", Px(1.15 * width_), "px\" viewBox=\"0 0 ",
                      Px(width_), " ", Px(height_), "\" role=\"img\" aria-label=\"", Escape(description),
                      "\">", Frame(), marks_, "</svg>");
}

std::string IntervalPicture(const v1::ParameterValue& parameter) {
  if (!(parameter.lower() < parameter.upper()) || !std::isfinite(parameter.upper() - parameter.lower()))
    return "";
  RangeFinder finder;
  for (const double x : {0.0, parameter.lower(), parameter.upper(), parameter.value()}) finder.Add(x);
  if (parameter.has_before()) finder.Add(parameter.before());
  const Range range = finder.Get(0.06);
  const auto x = [&](double value) { return Px(150 * (value - range.low) / (range.high - range.low)); };
  std::string svg = absl::StrCat(
      "<svg class=\"chart interval\" viewBox=\"0 0 150 16\" role=\"img\" aria-label=\"",
      Escape(absl::StrCat("95 % interval ", Interval(parameter), ", zero marked")),
      "\"><path class=\"axis\" d=\"M0 8H150\"/>", "<path class=\"zero\" d=\"M", x(0), " 2V14\"/>");
  if (parameter.has_before()) {
    absl::StrAppend(&svg, "<path class=\"dots given\" style=\"stroke-width:7;opacity:1\" d=\"M",
                    x(parameter.before()), " 8h0\"/>");
  }
  return absl::StrCat(svg, "<path class=\"line better\" d=\"M", x(parameter.lower()), " 8H",
                      x(parameter.upper()),
                      "\"/><path class=\"dots better\" style=\"stroke-width:7;opacity:1\" d=\"M",
                      x(parameter.value()), " 8h0\"/></svg>");
}

}  // namespace touchstone::client
