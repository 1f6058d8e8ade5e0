// Where: slices, groups, residual against every covariate.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"
#include "client/report/svg_chart.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

constexpr double kDependenceP = 0.01;
constexpr size_t kMinCurves = 4;  // shown even if the residual depends on none of them

std::string Slices(const v1::DataReport& data) {
  if (data.where().empty()) return "";
  const ErrorScale scale(data);
  std::string table = absl::StrCat("<div class=\"scroll\"><table>",
                                   HeaderRow({"Part of the data", scale.pictures() ? ">Pictures" : ">Touches",
                                              ">Share of the excess", "", ">Mean residual", "In words"}),
                                   "<tbody>");
  for (const v1::Slice& slice : data.where()) {
    absl::StrAppend(&table, "<tr>", Cell(Typeset(slice.slice()), "name"), NumberCell(Count(slice.count())),
                    NumberCell(Share(slice.share_of_excess_error())),
                    Cell(Bar(slice.share_of_excess_error(), "given"), "barcell narrow"),
                    NumberCell(scale.Signed(slice.mean_residual())), Cell(Typeset(slice.words())), "</tr>\n");
  }
  return Figure(
      absl::StrCat(table, "</tbody></table></div>"),
      absl::StrCat(
          "Excess: the mean square error of the given model beyond the noise floor. Residuals are measured "
          "minus simulated: positive means that ",
          scale.pictures() ? "the picture is brighter" : "the real contact came later",
          " than the model says."));
}

// "Object", "Time in the session".
std::string GroupTitle(v1::GroupError::Kind kind) {
  if (kind == v1::GroupError::TIME) return "Time in the session";
  std::string name = absl::AsciiStrToLower(v1::GroupError::Kind_Name(kind));
  name[0] = absl::ascii_toupper(name[0]);
  return name;
}

std::string Groups(const v1::DataReport& data) {
  std::vector<v1::GroupError::Kind> order;
  std::map<v1::GroupError::Kind, std::vector<const v1::GroupError*>> kinds;
  double largest = 0;
  const ErrorScale scale(data);
  for (const v1::GroupError& group : data.groups()) {
    if (kinds[group.kind()].empty()) order.push_back(group.kind());
    kinds[group.kind()].push_back(&group);
    largest = std::max(largest, group.rmse());
  }
  if (order.empty()) return "";
  const double floor = NoiseFloorOf(data).sigma;
  std::string grid;
  for (const v1::GroupError::Kind kind : order) {
    if (kinds[kind].size() < 2) continue;  // one group is the whole set
    std::string table =
        absl::StrCat("<table>", HeaderRow({GroupTitle(kind), ">RMSE", "", ">of excess"}), "<tbody>");
    for (const v1::GroupError* group : kinds[kind]) {
      absl::StrAppend(
          &table, "<tr title=\"",
          Escape(absl::StrCat(Count(group->count()), " ", scale.readings(), ", mean residual ",
                              scale.Signed(group->mean_residual()))),
          "\">", Cell(Escape(group->name())), NumberCell(scale.Text(group->rmse())),
          Cell(Bar(group->rmse() / largest, "given", floor > 0 ? floor / largest : -1), "barcell"),
          NumberCell(Share(group->share_of_excess_error())), "</tr>");
    }
    absl::StrAppend(&grid, "<figure>", table, "</tbody></table></figure>\n");
  }
  return absl::StrCat(
      "<h3>By group</h3>\n<div class=\"grid groups\">", grid,
      "</div>\n<p class=\"note\">RMSE of the given model within each group, all on one scale; dashed the "
      "noise floor. Last column: the group\u2019s share of the error beyond the floor.</p>\n");
}

// "first" is 1 for the finger that touched first, as in formulas.
std::string AxisTitle(const v1::CovariateCurve& curve) {
  if (curve.covariate() == "first") return "later finger (0) or first (1)";
  if (curve.covariate() == "touch_number") return "touch number";
  return Covariate(curve.covariate(), curve.unit());
}

// "p 3e-9, with the improved model 0.40"
std::string DependenceWords(double p, double p_after, bool improved) {
  return absl::StrCat("p ", Probability(p),
                      improved ? absl::StrCat(" given, ", Probability(p_after), " improved") : "");
}

// Each finger alone, of curves over the place in the session.
std::string FingerDependences(const v1::CovariateCurve& curve, bool improved) {
  std::string items;
  for (const v1::FingerDependence& finger : curve.fingers())
    absl::StrAppend(&items, items.empty() ? "" : "; ", "finger ", Escape(finger.finger()), " ",
                    Typeset(DependenceWords(finger.p(), finger.p_after(), improved)));
  return items.empty() ? "" : absl::StrCat("<figcaption>", items, "</figcaption>");
}

// Before and after share the vertical axis, in the unit that fits the larger.
std::string CurvePair(const ErrorScale& scale, const v1::CovariateCurve& curve, bool improved) {
  RangeFinder x, y;
  y.Add(0);
  double size = 0;
  for (const v1::CurveBin& bin : curve.bins()) {
    const double error = std::isfinite(bin.std_error()) ? bin.std_error() : 0;
    size = std::max({size, std::abs(bin.mean_residual()), std::abs(bin.after())});
    x.Add(bin.centre());
    for (const double value : {bin.mean_residual() - error, bin.mean_residual() + error, bin.after()})
      y.Add(value);
  }
  const TimeUnit unit = scale.UnitFor(size);
  const Range us = y.Get();
  const Chart::Axis x_axis = {AxisTitle(curve), x.Get()};
  const Chart::Axis y_axis = {absl::StrCat("mean residual (", unit.symbol, ")"),
                              {us.low * unit.per_us, us.high * unit.per_us}};
  std::string pair;
  for (const bool after : {false, true}) {
    if (after && !improved) break;
    Chart chart(improved ? 232 : 480, 190, after ? "improved model" : "given model", x_axis, y_axis);
    chart.ZeroLine();
    std::vector<std::string> fingers;
    for (const v1::CurveBin& bin : curve.bins()) {
      if (std::find(fingers.begin(), fingers.end(), bin.finger()) == fingers.end())
        fingers.push_back(bin.finger());
    }
    for (size_t f = 0; f < fingers.size(); ++f) {
      std::vector<ChartPoint> points;
      std::vector<double> errors;
      for (const v1::CurveBin& bin : curve.bins()) {
        if (bin.finger() != fingers[f]) continue;
        points.push_back({bin.centre(), (after ? bin.after() : bin.mean_residual()) * unit.per_us});
        errors.push_back(bin.std_error() * unit.per_us);
      }
      const std::string css = absl::StrCat("f", f % 6);
      if (!after) chart.Whiskers(points, errors, css);
      chart.Line(points, css);
    }
    pair += chart.Svg(absl::StrCat("Mean residual", scale.pictures() ? "" : " of each finger", " against ",
                                   x_axis.title, ", ", after ? "improved model" : "given model"));
  }
  const bool still = improved && curve.p_after() < kDependenceP;
  return absl::StrCat("<figure><p class=\"head\">", Typeset(x_axis.title), " <span>",
                      Typeset(DependenceWords(curve.p(), curve.p_after(), improved)),
                      still                      ? ": the residual still depends on it"
                      : curve.p() < kDependenceP ? ": the residual depends on it"
                                                 : "",
                      "</span></p><div class=\"pair\">", pair, "</div>", FingerDependences(curve, improved),
                      "</figure>\n");
}

// Strongest dependence first; those of numbered groups (face 3) are left to the tables of groups.
std::vector<const v1::CovariateCurve*> CurvesToShow(const v1::DataReport& data) {
  std::set<std::string> kinds;
  for (const v1::GroupError& group : data.groups())
    kinds.insert(absl::AsciiStrToLower(v1::GroupError::Kind_Name(group.kind())));
  std::vector<const v1::CovariateCurve*> curves;
  for (const v1::CovariateCurve& curve : data.curves()) {
    if (!curve.bins().empty() && kinds.count(curve.covariate()) == 0) curves.push_back(&curve);
  }
  const auto rank = [](const v1::CovariateCurve* curve) {
    return std::isnan(curve->p()) ? 2 : std::min(curve->p(), curve->p_after());
  };
  std::stable_sort(curves.begin(), curves.end(),
                   [&](const auto* a, const auto* b) { return rank(a) < rank(b); });
  return curves;
}

std::string Curves(const v1::DataReport& data, bool improved) {
  const ErrorScale scale(data);
  const std::vector<const v1::CovariateCurve*> curves = CurvesToShow(data);
  if (curves.empty()) return "";
  std::string open, folded;
  std::vector<std::pair<std::string, std::string>> keys;
  size_t shown = 0;
  for (const v1::CovariateCurve* curve : curves) {
    // The place in the session is always shown: what changes with it is no noise.
    const bool depends = curve->p() < kDependenceP || curve->p_after() < kDependenceP ||
                         !curve->fingers().empty() || shown < kMinCurves;
    (depends ? open : folded) += CurvePair(scale, *curve, improved);
    shown += depends;
    for (const v1::CurveBin& bin : curve->bins()) {
      const std::string finger = absl::StrCat("finger ", bin.finger());
      const auto same = [&](const auto& key) { return key.second == finger; };
      if (bin.finger().empty() || std::any_of(keys.begin(), keys.end(), same)) continue;
      keys.push_back({absl::StrCat("f", keys.size() % 6), finger});
    }
  }
  if (!folded.empty()) {
    folded = absl::StrCat("<details><summary>", curves.size() - shown,
                          " more, on which the residual does not depend</summary><div class=\"grid wide\">",
                          folded, "</div></details>\n");
  }
  return absl::StrCat(
      "<h3>Residual against every covariate</h3>\n", Legend(keys), "<div class=\"grid wide\">", open,
      "</div>\n", folded,
      "<p class=\"note\">Means within bins, whiskers one standard error. p: of any dependence, by "
      "permutation, corrected for the number of covariates",
      scale.pictures() ? "; pictures of one pose count as one.</p>\n"
                       : " (and of fingers, where each is tested alone). Only differences between "
                         "fingers are measured, so what "
                         "one finger does shows in the others with the other sign.</p>\n");
}

}  // namespace

std::string HtmlWhere(const v1::Report& report) {
  const bool improved = !report.improved_model_yaml().empty();
  const std::string body = PerKind(report, [&](const v1::DataReport& data) {
    return absl::StrCat(Slices(data), Groups(data), Curves(data, improved));
  });
  return Section("where", "Where", "The parts of the data in which the given model is wrong.", body);
}

}  // namespace touchstone::client
