// Next touches, drawn on the objects and listed; sets without poses.
#include <algorithm>
#include <cmath>
#include <map>

#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/svg_object.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

Vector Of(const v1::Vector3& v, double scale) {
  return {v.x() * scale, v.y() * scale, v.z() * scale};
}

Vector Along(const Vector& from, const Vector& direction, double distance) {
  return {from[0] + distance * direction[0], from[1] + distance * direction[1],
          from[2] + distance * direction[2]};
}

// An arrow that ends where the middle finger meets the surface, its tail a bar along the row of fingers.
std::string Arrow(const ObjectPicture& picture, const View& view, const v1::CommandedTouch& touch,
                  int number) {
  const Vector target = Of(touch.target_m(), 1000), approach = Of(touch.approach(), 1),
               lateral = Of(touch.lateral(), 1);
  const Vector start = Along(target, approach, -std::max(touch.standoff_m() * 1000, picture.size_mm()));
  Vector tip;
  if (!picture.Hit(start, approach, &tip)) tip = target;
  const double length = 0.2 * picture.size_mm(), bar = 0.06 * picture.size_mm();
  const Vector tail = Along(tip, approach, -length);
  const auto px = [&](const Vector& point) {
    const auto p = picture.Project(view, point);
    return absl::StrCat(std::lround(p.x), " ", std::lround(p.y));
  };
  const auto from = picture.Project(view, tail), to = picture.Project(view, tip);
  const double dx = to.x - from.x, dy = to.y - from.y, size = std::max(1.0, std::hypot(dx, dy));
  // The head: two short strokes back from the tip, in the picture's plane.
  std::string head;
  for (const double side : {0.5, -0.5}) {
    absl::StrAppend(&head, "M", px(tip), "L", std::lround(to.x - 11 * dx / size + side * 12 * dy / size), " ",
                    std::lround(to.y - 11 * dy / size - side * 12 * dx / size));
  }
  return absl::StrCat("<path class=\"arrow\" d=\"M", px(Along(tail, lateral, -bar)), "L",
                      px(Along(tail, lateral, bar)), "M", px(tail), "L", px(tip), head,
                      "\"/><text class=\"label\" text-anchor=\"middle\" x=\"",
                      std::lround(from.x - 22 * dx / size), "\" y=\"",
                      std::lround(from.y - 20 * dy / size + 8), "\">", number, "</text>");
}

using NextTouches = std::vector<const v1::NextMeasurement*>;

std::string Pictures(const v1::Report& report, const NextTouches& next) {
  std::map<std::string, std::vector<int>> touches;
  for (int i = 0; i < static_cast<int>(next.size()); ++i) touches[next[i]->object()].push_back(i);
  std::string grid;
  std::vector<const v1::ObjectOutline*> outlines;
  for (const v1::DataReport& data : report.data())
    for (const v1::ObjectOutline& outline : data.outlines()) outlines.push_back(&outline);
  for (const v1::ObjectOutline* one : outlines) {
    const v1::ObjectOutline& outline = *one;
    const auto found = touches.find(outline.object());
    if (found == touches.end()) continue;
    const ObjectPicture picture(outline, {});
    for (const bool back : {false, true}) {
      const View view = back ? kBackView : kFrontView;
      std::string arrows;
      for (const int i : found->second) {
        const v1::CommandedTouch& touch = next[i]->touch();
        // From the side on which the finger can be seen to come in.
        if (Dot(Of(touch.approach(), 1), Towards(view)) < 0) arrows += Arrow(picture, view, touch, i + 1);
      }
      if (arrows.empty()) continue;
      const std::string words = absl::StrCat(Escape(outline.object()), ", from ",
                                             back ? "behind and below" : "the front and above");
      grid += Figure(
          absl::StrCat("<svg class=\"map\" viewBox=\"-50 -50 500 500\" role=\"img\" aria-label=\"Proposed "
                       "touches on ",
                       words, "\">", picture.Faces(view), arrows, "</svg>"),
          words);
    }
  }
  return grid.empty() ? "" : absl::StrCat("<div class=\"grid arrows\">", grid, "</div>\n");
}

std::string Direction(const v1::Vector3& v) {
  return absl::StrCat(Fixed(v.x(), 2), " ", Fixed(v.y(), 2), " ", Fixed(v.z(), 2));
}

}  // namespace

std::string HtmlNextTouches(const v1::Report& report) {
  NextTouches touches;
  for (const v1::NextMeasurement& next : report.next())
    if (next.has_touch()) touches.push_back(&next);
  if (touches.empty()) return "";
  // A purpose that all share is said once.
  const std::string& first = touches[0]->purpose();
  const bool one_purpose =
      std::all_of(touches.begin(), touches.end(), [&](const auto* next) { return next->purpose() == first; });
  std::vector<std::string> titles = {">No.",      "Object",        ">Target x y z (mm)",
                                     ">Approach", ">Speed (mm/s)", ">Apart (sigmas)"};
  if (!one_purpose) titles.push_back("What it is for");
  std::string table = absl::StrCat("<div class=\"scroll\"><table>", HeaderRow(titles), "<tbody>");
  for (size_t i = 0; i < touches.size(); ++i) {
    const v1::NextMeasurement& next = *touches[i];
    const v1::Vector3& t = next.touch().target_m();
    absl::StrAppend(&table, "<tr>", NumberCell(absl::StrCat(i + 1)), Cell(Escape(next.object())),
                    NumberCell(absl::StrCat(Fixed(1000 * t.x(), 1), " ", Fixed(1000 * t.y(), 1), " ",
                                            Fixed(1000 * t.z(), 1))),
                    NumberCell(Direction(next.touch().approach())),
                    NumberCell(Tick(1000 * next.touch().speed_m_s())),
                    NumberCell(Number(next.separation(), 2)),
                    one_purpose ? "" : Cell(Typeset(next.purpose())), "</tr>\n");
  }
  // Each purpose with what it takes.
  std::map<std::string, std::string> verdicts;
  for (const v1::NextMeasurement* next : touches) {
    const std::string verdict = CountToVerdict(*next);
    if (!verdict.empty()) verdicts.emplace(next->purpose(), verdict);
  }
  std::string needed;
  for (const auto& [purpose, verdict] : verdicts)
    absl::StrAppend(&needed, "<p>",
                    one_purpose || purpose.empty() ? "It takes " : absl::StrCat(Typeset(purpose), ": "),
                    Typeset(verdict), ".</p>\n");
  return Section(
      "next", "Next touches",
      one_purpose && !first.empty() ? absl::StrCat("What they are for: ", Typeset(first), ".")
                                    : "Touches that would discriminate between the remaining explanations.",
      absl::StrCat(
          needed, Pictures(report, touches),
          Figure(absl::StrCat(table, "</tbody></table></div>"),
                 "Arrows end where the middle finger should meet the surface; the bar at the tail lies "
                 "along the row of fingers. Apart: the expected difference between the explanations, in "
                 "standard deviations of the noise. To a verdict: until the expected log evidence between "
                 "the two "
                 "is 6 nats (odds of 400), if one of them is the cause.")));
}

std::string HtmlDistributions(const v1::Report& report) {
  if (!MainData(report).has_distributions()) return "";
  const v1::DistributionComparison& comparison = MainData(report).distributions();
  std::string body = absl::StrCat(
      "<p>Energy distance ", Typeset(Number(comparison.energy_distance())), ", p ",
      Typeset(Probability(comparison.p())), ", against ", Typeset(Count(comparison.simulated_touches())),
      " simulated touches",
      comparison.plan().empty() ? "" : absl::StrCat(" (", Typeset(comparison.plan()), ")"), ".</p>\n");
  if (!comparison.findings().empty()) {
    absl::StrAppend(&body, "<h3>What repeats show</h3>\n<div class=\"scroll\"><table>",
                    HeaderRow({"Finding", ">p", "Effects that would do it"}), "<tbody>");
    for (const v1::RepeatFinding& finding : comparison.findings()) {
      const std::vector<std::string> effects(finding.compatible_effects().begin(),
                                             finding.compatible_effects().end());
      absl::StrAppend(&body, "<tr>", Cell(Typeset(finding.words())), NumberCell(Probability(finding.p())),
                      Cell(effects.empty() ? "none of the catalogue" : Escape(Join(effects, "or"))), "</tr>");
    }
    body +=
        "</tbody></table></div>\n<p class=\"note\">p: how often repeats that change places within their "
        "pose, or "
        "Gaussian noise, show as much; paid for every test.</p>\n<h3>Distributions against the model</h3>\n";
  }
  if (!comparison.statistics().empty()) {
    absl::StrAppend(&body, "<div class=\"scroll\"><table>",
                    HeaderRow({"Statistic", ">measured", ">simulated", ">p"}), "<tbody>");
    for (const v1::StatisticTest& test : comparison.statistics()) {
      const auto shown = [&](double value) {
        return test.unit() == "us" ? Time(value)
                                   : absl::StrCat(Number(value), test.unit().empty() ? "" : " ", test.unit());
      };
      absl::StrAppend(&body, test.p() < 0.01 ? "<tr>" : "<tr class=\"dim\">",
                      Cell(Escape(test.name()), "name"), NumberCell(shown(test.measured())),
                      NumberCell(shown(test.simulated())), NumberCell(Probability(test.p())), "</tr>");
    }
    body += "</tbody></table></div>\n";
  }
  if (!comparison.compatible_effects().empty()) {
    const std::vector<std::string> effects(comparison.compatible_effects().begin(),
                                           comparison.compatible_effects().end());
    absl::StrAppend(&body, "<h3>Compatible effects</h3>\n<p>The difference could be explained by ",
                    Escape(Join(effects, "or")), ". Only touches with poses can tell which.</p>\n");
  }
  body +=
      "<p class=\"note\">p: how often a set that the model makes in the same way (same objects, touches and "
      "rounds, other poses) lies as far from a large simulated one; by the energy distance between "
      "descriptors, and of each statistic by the Kolmogorov-Smirnov distance.</p>\n";
  return Section("distributions", "Distributions",
                 "The set has no poses, so touches cannot be compared one by one.", body);
}

}  // namespace touchstone::client
