#include "client/report/path_drawing.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace touchstone::client {
namespace {

// Pixels.
constexpr double kWidth = 1280, kMargin = 48, kHead = 96, kPanelGap = 72, kReasonHeight = 22;
constexpr double kPanelWidth = (kWidth - 2 * kMargin - kPanelGap) / 2, kMaxPanelHeight = 620;
constexpr double kEdgeM = 0.03;  // around what is drawn
constexpr size_t kMaxReasons = 8, kMaxReasonLetters = 150;
constexpr size_t kMaxNumbers = 40;  // more possible touches than these are not numbered

constexpr char kStyle[] = R"(
  text { font-family: 'Inter', 'Helvetica Neue', 'DejaVu Sans', sans-serif; fill: #334155; }
  .title { font-size: 22px; font-weight: 600; fill: #0f172a; } .summary { font-size: 14px; fill: #475569; }
  .panel { fill: #ffffff; stroke: #cbd5e1; } .grid { stroke: #eef2f7; } .tick { font-size: 11px; fill: #64748b; }
  .view { font-size: 14px; font-weight: 600; }
  .object { fill: #fef3c7; stroke: #d97706; stroke-width: 1.4; }
  .limits { fill: none; stroke: #64748b; stroke-width: 1.4; stroke-dasharray: 7 5; }
  .transit { fill: none; stroke: #94a3b8; stroke-width: 1; stroke-opacity: .55; }
  .approach { stroke: #0f766e; stroke-width: 1.7; stroke-opacity: .8; } .start { fill: #0f766e; }
  .beyond { stroke: #0f766e; stroke-width: 1; stroke-opacity: .35; stroke-dasharray: 2 2; }
  .many .approach { stroke-width: 1; stroke-opacity: .5; } .many .beyond { stroke-opacity: .15; }
  .number { font-size: 10px; fill: #0f766e; paint-order: stroke; stroke: #ffffff; stroke-width: 3px; }
  .bad { stroke: #dc2626; stroke-width: 2; fill: none; }
  .badnumber { font-size: 12px; font-weight: 700; fill: #dc2626; paint-order: stroke; stroke: #ffffff;
    stroke-width: 3px; }
  .reason { font-size: 13px; } .reasonnumber { font-weight: 700; fill: #dc2626; }
)";

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

struct Extent {
  Eigen::Vector3d least = Eigen::Vector3d::Constant(1e9), greatest = Eigen::Vector3d::Constant(-1e9);
  void Add(const Eigen::Vector3d& point) {
    if (!point.allFinite()) return;
    least = least.cwiseMin(point), greatest = greatest.cwiseMax(point);
  }
};

Extent ExtentOf(const PathDrawing& drawing) {
  Extent extent;
  for (const DrawnTouch& touch : drawing.touches) {
    for (const Eigen::Vector3d& point : touch.path) extent.Add(point);
    if (touch.target_m.has_value()) extent.Add(*touch.target_m);
  }
  if (drawing.object.has_value()) extent.Add(drawing.object->first), extent.Add(drawing.object->second);
  if (extent.least.x() > extent.greatest.x()) extent.Add(Eigen::Vector3d::Zero());
  extent.least.array() -= kEdgeM, extent.greatest.array() += kEdgeM;
  return extent;
}

// One view: x to the right, and another axis up.
class Panel {
 public:
  Panel(std::string id, std::string view, int up, double left, const Extent& extent, double scale,
        double height)
      : id_(std::move(id)), view_(std::move(view)), up_(up), left_(left), scale_(scale), height_(height) {
    centre_ = 0.5 * (extent.least + extent.greatest);
  }

  std::string Draw(const PathDrawing& drawing) const {
    const bool numbered = drawing.touches.size() <= kMaxNumbers;
    std::string svg = absl::StrFormat(
        "<clipPath id=\"%s\"><rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/></clipPath>\n", id_,
        left_, kHead, kPanelWidth, height_);
    absl::StrAppend(&svg, Rectangle("panel", left_, kHead, kPanelWidth, height_),
                    absl::StrFormat("<g clip-path=\"url(#%s)\"%s>\n", id_, numbered ? "" : " class=\"many\""),
                    Grid());
    if (drawing.object.has_value()) absl::StrAppend(&svg, Box("object", *drawing.object));
    if (drawing.limits.has_value()) absl::StrAppend(&svg, Box("limits", *drawing.limits));
    // What is wrong is drawn last, over everything.
    for (const DrawnTouch& touch : drawing.touches) absl::StrAppend(&svg, Transit(touch));
    for (const DrawnTouch& touch : drawing.touches)
      if (touch.possible) absl::StrAppend(&svg, Approach(touch, numbered));
    for (const DrawnTouch& touch : drawing.touches)
      if (!touch.possible) absl::StrAppend(&svg, Impossible(touch));
    return absl::StrCat(svg, "</g>\n", Ticks(),
                        absl::StrFormat("<text class=\"view\" x=\"%.1f\" y=\"%.1f\">%s</text>\n", left_ + 12,
                                        kHead + 24, view_));
  }

 private:
  double X(double x_m) const { return left_ + kPanelWidth / 2 + scale_ * (x_m - centre_.x()); }
  double Y(double up_m) const { return kHead + height_ / 2 - scale_ * (up_m - centre_[up_]); }
  std::string Point(const Eigen::Vector3d& p) const {
    return absl::StrFormat("%.1f,%.1f", X(p.x()), Y(p[up_]));
  }

  static std::string Rectangle(const char* style, double x, double y, double width, double height) {
    return absl::StrFormat("<rect class=\"%s\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
                           style, x, y, width, height);
  }
  std::string Box(const char* style, const std::pair<Eigen::Vector3d, Eigen::Vector3d>& box) const {
    return Rectangle(style, X(box.first.x()), Y(box.second[up_]), scale_ * (box.second.x() - box.first.x()),
                     scale_ * (box.second[up_] - box.first[up_]));
  }

  // Lines of the grid, as far apart as leaves room for their numbers.
  double GridM() const {
    for (const double step_m : {0.01, 0.02, 0.05, 0.1, 0.2, 0.5})
      if (scale_ * step_m >= 55) return step_m;
    return 1;
  }
  template <typename Each>
  void ForEachLine(double centre_m, double half_m, Each each) const {
    const double step_m = GridM();
    for (double i = std::ceil((centre_m - half_m) / step_m); i * step_m <= centre_m + half_m; ++i)
      each(i * step_m + 0.0);  // no -0
  }
  std::string Grid() const {
    std::string svg;
    ForEachLine(centre_.x(), kPanelWidth / 2 / scale_, [&](double at_m) {
      absl::StrAppendFormat(&svg, "<path class=\"grid\" d=\"M%.1f %.1fv%.1f\"/>\n", X(at_m), kHead, height_);
    });
    ForEachLine(centre_[up_], height_ / 2 / scale_, [&](double at_m) {
      absl::StrAppendFormat(&svg, "<path class=\"grid\" d=\"M%.1f %.1fh%.1f\"/>\n", left_, Y(at_m),
                            kPanelWidth);
    });
    return svg;
  }
  std::string Ticks() const {
    std::string svg;
    const double below = kHead + height_;
    ForEachLine(centre_.x(), kPanelWidth / 2 / scale_, [&](double at_m) {
      absl::StrAppendFormat(&svg,
                            "<text class=\"tick\" text-anchor=\"middle\" x=\"%.1f\" y=\"%.1f\">%.0f</text>\n",
                            X(at_m), below + 16, at_m / kMetresPerMillimetre);
    });
    ForEachLine(centre_[up_], height_ / 2 / scale_, [&](double at_m) {
      absl::StrAppendFormat(&svg,
                            "<text class=\"tick\" text-anchor=\"end\" x=\"%.1f\" y=\"%.1f\">%.0f</text>\n",
                            left_ - 6, Y(at_m) + 4, at_m / kMetresPerMillimetre);
    });
    absl::StrAppendFormat(&svg,
                          "<text class=\"tick\" text-anchor=\"end\" x=\"%.1f\" y=\"%.1f\">x, mm</text>\n",
                          left_ + kPanelWidth, below + 32);
    absl::StrAppendFormat(&svg,
                          "<text class=\"tick\" text-anchor=\"end\" x=\"%.1f\" y=\"%.1f\">%c, mm</text>\n",
                          left_ - 6, kHead - 6, "xyz"[up_]);
    return svg;
  }

  std::string Transit(const DrawnTouch& touch) const {
    if (!touch.possible || touch.transit_poses < 2 || touch.path.size() < touch.transit_poses) return "";
    std::string points;
    for (size_t i = 0; i < touch.transit_poses; ++i)
      absl::StrAppend(&points, i == 0 ? "" : " ", Point(touch.path[i]));
    return absl::StrCat("<polyline class=\"transit\" points=\"", points, "\"/>\n");
  }
  std::string Approach(const DrawnTouch& touch, bool numbered) const {
    if (touch.transit_poses < 1 || touch.path.size() <= touch.transit_poses) return "";
    // To the target, where a contact is expected; beyond it the arm only goes if there is none.
    const Eigen::Vector3d &start = touch.path[touch.transit_poses - 1], &end = touch.path.back();
    const Eigen::Vector3d target = touch.target_m.value_or(end);
    std::string svg = absl::StrFormat(
        "<path class=\"beyond\" d=\"M%s L%s\"/><path class=\"approach\" marker-end=\"url(#arrow)\" d=\"M%s "
        "L%s\"/><circle class=\"start\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n",
        Point(target), Point(end), Point(start), Point(target), X(start.x()), Y(start[up_]),
        numbered ? 2.4 : 1.5);
    if (numbered)
      absl::StrAppendFormat(&svg, "<text class=\"number\" x=\"%.1f\" y=\"%.1f\">%d</text>\n",
                            X(start.x()) + 5, Y(start[up_]) - 4, touch.number);
    return svg;
  }
  std::string Impossible(const DrawnTouch& touch) const {
    if (!touch.target_m.has_value() && touch.path.empty()) return "";
    const Eigen::Vector3d at = touch.target_m.has_value() ? *touch.target_m : touch.path.back();
    const double x = X(at.x()), y = Y(at[up_]);
    return absl::StrFormat(
        "<path class=\"bad\" d=\"M%.1f %.1fl10 10m0 -10l-10 10\"/><text class=\"badnumber\" x=\"%.1f\" "
        "y=\"%.1f\">%d</text>\n",
        x - 5, y - 5, x + 8, y - 4, touch.number);
  }

  std::string id_, view_;
  int up_;
  double left_, scale_, height_;
  Eigen::Vector3d centre_;
};

std::string Reasons(const PathDrawing& drawing, double top, size_t impossible) {
  std::string svg;
  size_t listed = 0;
  for (const DrawnTouch& touch : drawing.touches) {
    if (touch.possible) continue;
    const double y = top + kReasonHeight * static_cast<double>(listed + 1);
    if (listed++ == kMaxReasons) {
      absl::StrAppendFormat(&svg, "<text class=\"reason\" x=\"%.1f\" y=\"%.1f\">and %d more</text>\n",
                            kMargin, y, impossible - kMaxReasons);
      break;
    }
    std::string reason = touch.reason.substr(0, kMaxReasonLetters);
    if (reason.size() < touch.reason.size()) reason += " ...";
    absl::StrAppendFormat(
        &svg,
        "<text class=\"reason\" x=\"%.1f\" y=\"%.1f\"><tspan class=\"reasonnumber\">%d</tspan>  %s</text>\n",
        kMargin, y, touch.number, Escaped(reason));
  }
  return svg;
}

// Samples of what the colours mean, in the upper right corner.
std::string Legend() {
  const double y = 40, x = kWidth - kMargin - 560;
  std::string svg;
  absl::StrAppendFormat(&svg, "<path class=\"approach\" marker-end=\"url(#arrow)\" d=\"M%.1f %.1fh26\"/>", x,
                        y);
  absl::StrAppendFormat(&svg, "<text class=\"summary\" x=\"%.1f\" y=\"%.1f\">approach</text>", x + 36, y + 5);
  absl::StrAppendFormat(&svg, "<path class=\"transit\" d=\"M%.1f %.1fh26\"/>", x + 120, y);
  absl::StrAppendFormat(&svg, "<text class=\"summary\" x=\"%.1f\" y=\"%.1f\">transit</text>", x + 154, y + 5);
  absl::StrAppendFormat(&svg, "<rect class=\"object\" x=\"%.1f\" y=\"%.1f\" width=\"22\" height=\"13\"/>",
                        x + 232, y - 6);
  absl::StrAppendFormat(&svg, "<text class=\"summary\" x=\"%.1f\" y=\"%.1f\">object's box</text>", x + 262,
                        y + 5);
  absl::StrAppendFormat(&svg, "<path class=\"limits\" d=\"M%.1f %.1fh26\"/>", x + 366, y);
  absl::StrAppendFormat(&svg, "<text class=\"summary\" x=\"%.1f\" y=\"%.1f\">limits</text>", x + 400, y + 5);
  absl::StrAppendFormat(&svg, "<path class=\"bad\" d=\"M%.1f %.1fl10 10m0 -10l-10 10\"/>", x + 458, y - 5);
  absl::StrAppendFormat(&svg, "<text class=\"summary\" x=\"%.1f\" y=\"%.1f\">impossible</text>\n", x + 476,
                        y + 5);
  return svg;
}

}  // namespace

std::string DrawPaths(const PathDrawing& drawing) {
  const Extent extent = ExtentOf(drawing);
  const Eigen::Vector3d size_m = extent.greatest - extent.least;
  const double tallest_m = std::max(size_m.y(), size_m.z());
  const double scale = std::min(kPanelWidth / size_m.x(), kMaxPanelHeight / tallest_m);
  const double panel_height = std::max(240.0, scale * tallest_m);
  const size_t impossible =
      static_cast<size_t>(std::count_if(drawing.touches.begin(), drawing.touches.end(),
                                        [](const DrawnTouch& touch) { return !touch.possible; }));
  const double reasons_top = kHead + panel_height + 44;
  const double height =
      reasons_top + kReasonHeight * (static_cast<double>(std::min(impossible, kMaxReasons + 1)) + 1);

  std::string svg = absl::StrFormat(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f "
      "%.0f\">\n<style>%s</style>\n"
      "<defs><marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"5\" "
      "markerHeight=\"5\" orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" fill=\"#0f766e\"/></marker></defs>\n"
      "<rect width=\"100%%\" height=\"100%%\" fill=\"#f8fafc\"/>\n",
      kWidth, height, kWidth, height, kStyle);
  absl::StrAppendFormat(&svg, "<text class=\"title\" x=\"%.1f\" y=\"42\">%s</text>\n", kMargin,
                        Escaped(drawing.title));
  absl::StrAppendFormat(
      &svg, "<text class=\"summary\" x=\"%.1f\" y=\"66\">%d of %d touches are possible%s</text>\n", kMargin,
      drawing.touches.size() - impossible, drawing.touches.size(),
      impossible == 0 ? "" : "; the others are red, with their number");
  absl::StrAppend(&svg, Legend());
  absl::StrAppend(&svg, Panel("above", "From above", 1, kMargin, extent, scale, panel_height).Draw(drawing));
  absl::StrAppend(&svg, Panel("beside", "From the side", 2, kMargin + kPanelWidth + kPanelGap, extent, scale,
                              panel_height)
                            .Draw(drawing));
  return absl::StrCat(svg, Reasons(drawing, reasons_top - 6, impossible), "</svg>\n");
}

}  // namespace touchstone::client
