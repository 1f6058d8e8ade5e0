// Measured against simulated: parity and histograms.
#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/svg_chart.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

constexpr int kMaxParityPoints = 6000;

std::string Parity(const v1::DataReport& data, bool improved) {
  if (data.parity().empty()) return "";
  const int step = 1 + data.parity_size() / kMaxParityPoints;
  RangeFinder finder;
  for (int i = 0; i < data.parity_size(); i += step) {
    finder.Add(data.parity(i).simulated());
    finder.Add(data.parity(i).measured());
    if (improved) finder.Add(data.parity(i).improved());
  }
  const Range us = finder.Get();
  const TimeUnit unit = UnitOfTime(std::max(std::abs(us.low), std::abs(us.high)));
  const Range range = {us.low * unit.per_us, us.high * unit.per_us};
  std::string pair;
  for (const bool after : {false, true}) {
    if (after && !improved) break;
    Chart chart(440, 430, after ? "improved model" : "given model",
                {absl::StrCat("simulated (", unit.symbol, ")"), range},
                {absl::StrCat("measured (", unit.symbol, ")"), range});
    std::vector<ChartPoint> points;
    for (int i = 0; i < data.parity_size(); i += step) {
      const v1::ParityPoint& point = data.parity(i);
      points.push_back(
          {(after ? point.improved() : point.simulated()) * unit.per_us, point.measured() * unit.per_us});
    }
    chart.Dots(points, after ? "better" : "given");
    chart.Line({{range.low, range.low}, {range.high, range.high}}, "ideal");
    pair += Figure(
        chart.Svg(absl::StrCat("Measured against simulated contact times, ",
                               after ? "improved model" : "given model", ", with the line of equality")),
        "");
  }
  return absl::StrCat(
      "<h3>Parity</h3>\n<div class=\"grid wide\">", pair,
      "</div>\n<p class=\"note\">One dot per finger and touch: contact times of a touch, relative to each "
      "other. On the dashed line, measured and simulated agree. ",
      Count((data.parity_size() + step - 1) / step), " of ", Count(data.parity_size()), " drawn.</p>\n");
}

std::string Title(v1::Histogram::Quantity quantity) {
  return quantity == v1::Histogram::CURVATURE_PER_M ? "Local curvature" : "Descriptor";
}

// "descriptor (us)" and the factor that brings it into the unit for people.
std::pair<std::string, double> Quantity(const v1::Histogram& histogram) {
  const double size = std::max(std::abs(*histogram.edges().begin()), std::abs(*histogram.edges().rbegin()));
  if (histogram.quantity() == v1::Histogram::CURVATURE_PER_M) return {"local curvature (1/m)", 1};
  const TimeUnit unit = UnitOfTime(size);
  return {absl::StrCat("descriptor (", unit.symbol, ")"), unit.per_us};
}

std::string HistogramChart(const v1::Histogram& histogram, bool improved) {
  if (histogram.edges_size() < 2) return "";
  const auto [title, scale] = Quantity(histogram);
  std::vector<double> edges, measured, simulated, better;
  for (const double edge : histogram.edges()) edges.push_back(edge * scale);
  RangeFinder y;
  y.Add(0);
  const auto densities = [&, scale = scale](const auto& values, std::vector<double>* out) {
    for (const double value : values) {
      out->push_back(value / scale);
      y.Add(value / scale);
    }
  };
  densities(histogram.measured(), &measured);
  densities(histogram.simulated(), &simulated);
  if (improved) densities(histogram.improved(), &better);
  // Densities are compared, not read: the axis shows the share of the peak.
  const double peak = y.Get(0).high;
  if (!(peak > 0)) return "";
  for (auto* values : {&measured, &simulated, &better}) {
    for (double& value : *values) value *= 100 / peak;
  }
  Chart chart(244, 190, histogram.object().empty() ? "all objects" : histogram.object(),
              {title, {edges.front(), edges.back()}}, {"density (% of the highest bin)", {0, 106}});
  chart.Steps(edges, measured, "measured");
  chart.Steps(edges, simulated, "line given");
  chart.Steps(edges, better, "line better");
  std::string caption = absl::StrCat("p ", Probability(histogram.p_simulated()), " given");
  if (improved) absl::StrAppend(&caption, ", ", Probability(histogram.p_improved()), " improved");
  return Figure(chart.Svg(absl::StrCat("Histogram of ", title, ", measured, given model",
                                       improved ? " and improved model" : "")),
                Typeset(caption));
}

std::string Histograms(const v1::DataReport& data, bool improved) {
  std::string grids;
  // A row of pictures for each quantity: all objects first, then each.
  std::vector<v1::Histogram::Quantity> quantities;
  for (const v1::Histogram& histogram : data.histograms()) {
    if (std::find(quantities.begin(), quantities.end(), histogram.quantity()) == quantities.end()) {
      quantities.push_back(histogram.quantity());
    }
  }
  for (const v1::Histogram::Quantity quantity : quantities) {
    std::string grid;
    for (const v1::Histogram& histogram : data.histograms()) {
      if (histogram.quantity() == quantity) grid += HistogramChart(histogram, improved);
    }
    if (!grid.empty())
      absl::StrAppend(&grids, "<h4>", Escape(Title(quantity)), "</h4>\n<div class=\"grid hist\">", grid,
                      "</div>\n");
  }
  if (grids.empty()) return "";
  std::vector<std::pair<std::string, std::string>> keys = {{"measured", "measured"},
                                                           {"given", "given model"}};
  if (improved) keys.push_back({"better", "improved model"});
  return absl::StrCat(
      "<h3>Histograms</h3>\n", Legend(keys), grids,
      "<p class=\"note\">Descriptor: a finger\u2019s contact time after the first finger\u2019s. Local "
      "curvature, for three fingers: speed \u00d7 (t<sub>l</sub> \u2212 2 t<sub>m</sub> + t<sub>r</sub>) / "
      "spacing\u00b2, positive where the surface is convex. p: that measured and simulated touches come "
      "from one distribution, by permutation.</p>\n");
}

}  // namespace

std::string HtmlFit(const v1::Report& report) {
  const bool improved = !report.improved_model_yaml().empty();
  return Section("fit", "Measured against simulated", "", PerKind(report, [&](const v1::DataReport& data) {
                   return absl::StrCat(Parity(data, improved), Histograms(data, improved));
                 }));
}

}  // namespace touchstone::client
