// What no effect explains: what the rest depends on, a formula or a curve that follows it.
#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"
#include "client/report/svg_chart.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

// The curve over its covariate, a dot at each knot. It is drawn over all of the data, where it is constant beyond its
// knots: a step of two knots next to each other would look like a slope.
std::string CurvePicture(const v1::DataReport& data) {
  const v1::UnexplainedCurve& curve = data.unexplained().curve();
  RangeFinder x, y;
  y.Add(0);
  double first = *curve.knots().begin(), last = *curve.knots().rbegin();
  for (const v1::CovariateCurve& residuals : data.curves())
    for (const v1::CurveBin& bin : residuals.bins()) {
      if (residuals.covariate() != curve.covariate()) continue;
      first = std::min(first, bin.centre());
      last = std::max(last, bin.centre());
    }
  x.Add(first), x.Add(last);
  for (const v1::FingerCurve& finger : curve.curves())
    for (const double value : finger.values()) y.Add(value);
  const std::string axis = Covariate(curve.covariate(), curve.covariate_unit());
  Chart chart(
      640, 260, "", {axis, x.Get()},
      {absl::StrCat(curve.unit() == "us" ? "added time (" : "added travel (", curve.unit(), ")"), y.Get()});
  chart.ZeroLine();
  std::vector<std::pair<std::string, std::string>> keys;
  for (int f = 0; f < curve.curves_size(); ++f) {
    const v1::FingerCurve& finger = curve.curves(f);
    std::vector<ChartPoint> points;
    for (int j = 0; j < std::min(curve.knots_size(), finger.values_size()); ++j)
      points.push_back({curve.knots(j), finger.values(j)});
    const std::string css = curve.curves_size() == 1 ? "better" : absl::StrCat("f", f % 6);
    if (points.empty()) continue;
    std::vector<ChartPoint> line = points;
    line.insert(line.begin(), {first, points.front().y});
    line.push_back({last, points.back().y});
    chart.Line(line, css);
    chart.Dots(points, absl::StrCat("knots ", css));
    keys.push_back(
        {css, finger.finger().empty() ? "every finger" : absl::StrCat("finger ", finger.finger())});
  }
  return absl::StrCat(Legend(keys), chart.Svg(absl::StrCat("The curve over ", axis)));
}

std::string LookupCurve(const v1::DataReport& data) {
  const v1::Unexplained& rest = data.unexplained();
  if (!rest.has_curve() || rest.curve().knots_size() < 2) return "";
  std::string terms;
  const auto add = [&terms](const char* term, const std::string& html) {
    absl::StrAppend(&terms, "<dt>", term, "</dt><dd>", html, "</dd>");
  };
  const ErrorScale scale(data);
  if (rest.formula().empty() && rest.heldout_rmse() > 0)
    add("It would leave", absl::StrCat(Typeset(scale.Text(rest.heldout_rmse())), " on ", scale.readings(),
                                       " left out of the fit; it removes ",
                                       Typeset(Share(rest.heldout_gain())), " of the excess error there"));
  if (!rest.nearest_formula().empty())
    add("Nearest simple formula", absl::StrCat("<code>", Escape(rest.nearest_formula()), "</code>, with ",
                                               Typeset(Share(rest.nearest_formula_share())),
                                               " of the curve\u2019s gain in log evidence"));
  if (rest.formula().empty() && !rest.nearest_effect().empty())
    add("Nearest effect", Typeset(NearestEffectWords(rest)));
  return absl::StrCat(
      "<h3>The curve that fits, without a name</h3>\n",
      Figure(CurvePicture(data),
             Typeset(absl::StrCat(
                 "Linear between its ", rest.curve().knots_size(),
                 " knots (dots), constant beyond them. A penalty keeps it as straight as the data "
                 "allow; where few touches lie it is a guess. A shift that all fingers share cannot "
                 "be measured."))),
      terms.empty() ? "" : absl::StrCat("<dl>", terms, "</dl>\n"),
      rest.formula_yaml().empty() && !rest.lookup_yaml().empty()
          ? absl::StrCat(
                "<h3>As text; <code>--save-model FILE --with-formula</code> adds it in its place</h3>\n<div "
                "class=\"row\"><button "
                "type=\"button\" data-copy=\"lookup\">Copy</button><span>or touchstone diagnose ... "
                "--save-model FILE --with-formula</span></div>\n<pre class=\"wrap\" id=\"lookup\">",
                Escape(rest.lookup_yaml()), "</pre>\n")
          : "");
}

// What one kind of measurement leaves.
std::string RestOf(const v1::DataReport& data) {
  const v1::Unexplained& rest = data.unexplained();
  std::string body;
  if (!rest.words().empty()) body = absl::StrCat("<p>", Typeset(rest.words()), "</p>\n");
  if (!rest.covariates().empty()) {
    absl::StrAppend(
        &body, "<div class=\"scroll\"><table class=\"narrow\">",
        HeaderRow({rest.covariates_size() > 1 ? "The rest depends, on each alone, on" : "The rest depends on",
                   ">p", ">gain in log evidence (nats)"}),
        "<tbody>");
    for (const v1::CovariateTest& test : rest.covariates()) {
      absl::StrAppend(&body, "<tr>", Cell(Escape(CovariateName(test.name())), "name"),
                      NumberCell(Probability(test.p())), NumberCell(Number(test.gain_nats())), "</tr>");
    }
    body += "</tbody></table></div>\n";
  }
  if (!rest.formula().empty()) {
    absl::StrAppend(&body, "<h3>A formula that fits, as a suggestion and not a cause</h3>\n<pre>",
                    Escape(rest.formula()), "</pre>\n<dl>");
    for (const v1::ParameterValue& parameter : rest.parameters()) {
      absl::StrAppend(&body, "<dt>", Escape(ParameterName(parameter)), "</dt><dd>",
                      Typeset(ValueWithError(parameter)), "</dd>");
    }
    const ErrorScale scale(data);
    if (rest.heldout_rmse() > 0) {
      absl::StrAppend(&body, "<dt>It would leave</dt><dd>", Typeset(scale.Text(rest.heldout_rmse())), " on ",
                      scale.readings(), " left out of the fit; it removes ",
                      Typeset(Share(rest.heldout_gain())), " of the excess error there</dd>");
    }
    if (!rest.nearest_effect().empty()) {
      absl::StrAppend(&body, "<dt>Nearest effect</dt><dd>", Typeset(NearestEffectWords(rest)), "</dd>");
    }
    body += "</dl>\n";
  }
  body += LookupCurve(data);
  if (!rest.formula_yaml().empty()) {
    absl::StrAppend(&body,
                    "<h3>As text; <code>--save-model FILE --with-formula</code> adds it in its place</h3>\n"
                    "<div class=\"row\"><button type=\"button\" data-copy=\"formula\">Copy</button></div>\n"
                    "<pre id=\"formula\">",
                    Escape(rest.formula_yaml()), "</pre>\n");
  }
  return body;
}

}  // namespace

std::string HtmlUnexplained(const v1::Report& report) {
  const std::string body = PerKind(report, RestOf);
  return Section(
      "unexplained", "What no built-in effect explains",
      "A structure that is left after all steps. p: likelihood ratio of the best term, all terms paid for.",
      body);
}

}  // namespace touchstone::client
