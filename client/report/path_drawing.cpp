#include "client/report/path_drawing.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include <algorithm>

#include "client/report/path_scene.h"

namespace touchstone::client {
namespace {

// Pixels.
constexpr double kWidth = 1280, kMargin = 48, kGap = 24, kHead = 128, kLineHeight = 22;
constexpr double kCloseWidth = 716, kOverviewWidth = kWidth - 2 * kMargin - kGap - kCloseWidth;
constexpr double kPanelHeight = 470, kFaceTitle = 40;
constexpr size_t kMaxLines = 8, kMaxLetters = 150;

constexpr char kStyle[] = R"(
  text { font-family: 'Inter', 'Helvetica Neue', 'DejaVu Sans', sans-serif; fill: #334155; }
  .title { font-size: 22px; font-weight: 600; fill: #0f172a; } .summary { font-size: 14px; fill: #475569; }
  .face { font-size: 16px; font-weight: 600; fill: #0f172a; }
  .panel { fill: #ffffff; stroke: #cbd5e1; } .tick { font-size: 11px; fill: #64748b; }
  .view { font-size: 13px; font-weight: 600; }
  .floor { stroke: #e2e8f0; stroke-width: 1; fill: none; }
  .object { stroke: #b45309; stroke-width: 1.2; stroke-linejoin: round; }
  .back { fill: #fef3c7; stroke-opacity: .45; } .front { fill: #fde68a; fill-opacity: .28; }
  .limits { fill: none; stroke: #64748b; stroke-width: 1; stroke-dasharray: 6 5; stroke-opacity: .8; }
  .transit { fill: none; stroke: #64748b; stroke-width: 1; stroke-opacity: .7; }
  .approach { fill: none; stroke: #0f766e; stroke-width: 1.8; } .start { fill: #0f766e; }
  .noted { fill: #f59e0b; stroke: #92400e; stroke-width: 1; }
  .fingers { fill: none; stroke: #0f766e; stroke-width: 3; stroke-opacity: .28; stroke-linecap: round; }
  .beyond { fill: none; stroke: #0f766e; stroke-width: 1.2; stroke-opacity: .5; stroke-dasharray: 2 3; }
  .many .approach { stroke-width: 1; stroke-opacity: .6; } .many .beyond { stroke-opacity: .2; }
  .many .fingers { stroke-width: 2; stroke-opacity: .12; }
  .arm { fill: none; stroke: #475569; stroke-width: 5; stroke-linejoin: round; stroke-linecap: round; stroke-opacity: .75; }
  .tool { fill: none; stroke: #475569; stroke-width: 2; }
  .joint { fill: #ffffff; stroke: #475569; stroke-width: 2; } .wrist { fill: #7c3aed; stroke: #ffffff; stroke-width: 1; }
  .camera { fill: #0284c7; stroke: #ffffff; stroke-width: 1; } .faint { fill-opacity: .45; stroke: none; }
  .axis { stroke-width: 2.2; fill: none; stroke-linecap: round; } .axisx { stroke: #dc2626; } .axisy { stroke: #16a34a; }
  .axisz { stroke: #2563eb; } .axisname { font-size: 12px; font-weight: 600; }
  .number { font-size: 11px; fill: #0f766e; paint-order: stroke; stroke: #ffffff; stroke-width: 3px; }
  .bad { stroke: #dc2626; stroke-width: 2; fill: none; }
  .badnumber { font-size: 12px; font-weight: 700; fill: #dc2626; paint-order: stroke; stroke: #ffffff;
    stroke-width: 3px; }
  .reason { font-size: 13px; } .reasonnumber { font-weight: 700; fill: #dc2626; }
  .notenumber { font-weight: 700; fill: #b45309; }
)";

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

// What the picture holds, and so the legend has.
struct Drawn {
  size_t touches = 0, impossible = 0, noted = 0;
  bool approach = false, beyond = false, fingers = false, transit = false, object = false, limits = false,
       arm = false, camera = false;
};

Drawn DrawnBy(const PathDrawing& drawing) {
  Drawn drawn;
  drawn.limits = drawing.limits.has_value();
  for (const DrawnFace& face : drawing.faces) {
    drawn.object = drawn.object || face.object.has_value();
    for (const DrawnTouch& touch : face.touches) {
      ++drawn.touches;
      drawn.impossible += touch.possible ? 0 : 1;
      drawn.noted += touch.possible && !touch.notes.empty() ? 1 : 0;
      drawn.arm = drawn.arm || touch.start.links.size() > 5;
      drawn.camera = drawn.camera || (touch.start.links.size() > 5 && touch.start.camera.has_value());
      if (!touch.possible || touch.transit_poses < 1 || touch.path.size() <= touch.transit_poses) continue;
      drawn.approach = true;
      drawn.beyond = drawn.beyond || touch.target_m.has_value();
      drawn.fingers = drawn.fingers || touch.start.tips.size() > 1;
      drawn.transit = drawn.transit || touch.transit_poses >= 2;
    }
  }
  return drawn;
}

// Samples of what is drawn, in a row.
std::string Legend(const Drawn& drawn, double y) {
  std::string svg;
  double x = kMargin;
  const auto add = [&](bool present, const std::string& sample, const std::string& name) {
    if (!present) return;
    absl::StrAppendFormat(
        &svg,
        "<g transform=\"translate(%.1f %.1f)\">%s<text class=\"summary\" x=\"34\" y=\"5\">%s</text></g>\n", x,
        y, sample, name);
    x += 34 + 7.6 * static_cast<double>(name.size()) + 20;
  };
  add(drawn.approach,
      "<circle class=\"start\" r=\"2.6\" cx=\"1\"/><path class=\"approach\" marker-end=\"url(#arrow)\" "
      "d=\"M0 0h26\"/>",
      "approach");
  add(drawn.beyond, "<path class=\"beyond\" d=\"M0 0h26\"/>", "only without contact");
  add(drawn.fingers, "<path class=\"fingers\" d=\"M2 0h22\"/>", "fingers");
  add(drawn.transit, "<path class=\"transit\" d=\"M0 0h26\"/>", "transit");
  add(drawn.object, "<rect class=\"object front\" x=\"2\" y=\"-7\" width=\"22\" height=\"14\"/>",
      "object's box");
  add(drawn.limits, "<path class=\"limits\" d=\"M0 0h26\"/>", "tips' limits");
  add(drawn.arm, "<path class=\"arm\" d=\"M3 0h20\"/>", "arm");
  add(drawn.arm, "<circle class=\"wrist\" r=\"4\" cx=\"13\"/>", "wrist");
  add(drawn.camera, "<rect class=\"camera\" x=\"8.5\" y=\"-4.5\" width=\"9\" height=\"9\"/>", "camera");
  add(drawn.noted > 0, "<circle class=\"noted\" r=\"4\" cx=\"13\"/>", "see note");
  add(drawn.impossible > 0, "<path class=\"bad\" d=\"M8 -5l10 10m0 -10l-10 10\"/>", "impossible");
  return svg;
}

struct Line {
  int number;
  std::string style, text;
};

std::vector<Line> LinesOf(const PathDrawing& drawing, bool impossible) {
  std::vector<Line> lines;
  for (const DrawnFace& face : drawing.faces)
    for (const DrawnTouch& touch : face.touches) {
      if (!touch.possible && impossible) lines.push_back({touch.number, "reasonnumber", touch.reason});
      if (touch.possible && !impossible)
        for (const std::string& note : touch.notes) lines.push_back({touch.number, "notenumber", note});
    }
  return lines;
}

// The first of them, and how many more there are; *y becomes that below.
std::string Listed(const std::vector<Line>& lines, double* y) {
  std::string svg;
  for (size_t k = 0; k < lines.size(); ++k) {
    *y += kLineHeight;
    if (k == kMaxLines) {
      absl::StrAppendFormat(&svg, "<text class=\"reason\" x=\"%.1f\" y=\"%.1f\">and %d more</text>\n",
                            kMargin, *y, lines.size() - kMaxLines);
      break;
    }
    std::string text = lines[k].text.substr(0, kMaxLetters);
    if (text.size() < lines[k].text.size()) text += " ...";
    absl::StrAppendFormat(
        &svg, "<text class=\"reason\" x=\"%.1f\" y=\"%.1f\"><tspan class=\"%s\">%d</tspan>  %s</text>\n",
        kMargin, *y, lines[k].style, lines[k].number, Escaped(text));
  }
  return svg;
}

std::string Face(const PathDrawing& drawing, size_t index, double top) {
  const DrawnFace& face = drawing.faces[index];
  const auto impossible = static_cast<size_t>(std::count_if(
      face.touches.begin(), face.touches.end(), [](const DrawnTouch& touch) { return !touch.possible; }));
  std::string svg = absl::StrFormat(
      "<text class=\"face\" x=\"%.1f\" y=\"%.1f\">%s <tspan class=\"summary\" font-weight=\"400\">  %d of %d "
      "touches "
      "possible</tspan></text>\n",
      kMargin, top + 26, Escaped(face.title), face.touches.size() - impossible, face.touches.size());
  const double panel_top = top + kFaceTitle;
  absl::StrAppend(
      &svg, DrawCloseUp({absl::StrCat("near", index), kMargin, panel_top, kCloseWidth, kPanelHeight}, face));
  absl::StrAppend(&svg, DrawOverview({absl::StrCat("arm", index), kMargin + kCloseWidth + kGap, panel_top,
                                      kOverviewWidth, kPanelHeight},
                                     face, drawing));
  return svg;
}

}  // namespace

std::string DrawPaths(const PathDrawing& drawing) {
  const Drawn drawn = DrawnBy(drawing);
  std::string body = absl::StrFormat("<text class=\"title\" x=\"%.1f\" y=\"46\">%s</text>\n", kMargin,
                                     Escaped(drawing.title));
  absl::StrAppendFormat(
      &body, "<text class=\"summary\" x=\"%.1f\" y=\"72\">%d of %d touches are possible%s%s</text>\n",
      kMargin, drawn.touches - drawn.impossible, drawn.touches,
      drawn.impossible == 0 ? "" : "; the others are red, with their number",
      drawn.noted == 0 ? "" : absl::StrFormat("; of %d something is noted below", drawn.noted));
  absl::StrAppend(&body, Legend(drawn, 102));
  double y = kHead;
  for (size_t k = 0; k < drawing.faces.size(); ++k) {
    absl::StrAppend(&body, Face(drawing, k, y));
    y += kFaceTitle + kPanelHeight + 18;
  }
  absl::StrAppend(&body, Listed(LinesOf(drawing, true), &y), Listed(LinesOf(drawing, false), &y));
  const double height = y + 30;
  return absl::StrCat(
      absl::StrFormat(
          "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f "
          "%.0f\">\n<style>%s</style>\n"
          "<defs><marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"5\" "
          "markerHeight=\"5\" orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" fill=\"#0f766e\"/></marker></defs>\n"
          "<rect width=\"100%%\" height=\"100%%\" fill=\"#f8fafc\"/>\n",
          kWidth, height, kWidth, height, kStyle),
      body, "</svg>\n");
}

}  // namespace touchstone::client
