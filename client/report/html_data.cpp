// The data behind the report: rows used and not, the noise floor, the worst touches, and how numbers came
// about.
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

std::string Term(const char* term, const std::string& text) {
  return text.empty() ? "" : absl::StrCat("<dt>", term, "</dt><dd>", Typeset(text), "</dd>");
}

std::string Floors(const v1::DataReport& data) {
  const Floor floor = NoiseFloorOf(data);
  if (!(floor.sigma > 0)) return "";
  const ErrorScale scale(data);
  std::string text = absl::StrCat(floor.bound ? "at most " : "", scale.Text(floor.sigma));
  const v1::NoiseFloor& detail = data.noise();
  if (detail.lower() > 0 && detail.lower() < detail.upper())
    absl::StrAppend(&text, ", 95 % interval ", scale.Text(detail.lower()), " to ",
                    scale.Text(detail.upper()));
  absl::StrAppend(&text,
                  floor.bound ? ", from the best model\u2019s residuals" : ", from repeats of the same ",
                  floor.bound ? "" : scale.one_reading());
  if (detail.degrees_of_freedom() > 0) {
    absl::StrAppend(&text, ", ", Count(detail.degrees_of_freedom()), " degrees of freedom");
  }
  return text;
}

std::string Summary(const v1::DataReport& data) {
  const v1::DataSummary& set = data.set();
  const std::vector<std::string> objects(set.objects().begin(), set.objects().end());
  std::vector<std::string> speeds;
  for (const double speed : set.speeds_mm_s()) speeds.push_back(Tick(speed));
  const ErrorScale scale(data);
  std::string terms;
  if (set.rows() > 0)
    terms += Term("Rows in the file",
                  absl::StrCat(Count(set.rows()), ", of which ", Count(data.count()), " used"));
  terms += Term("Objects", absl::StrJoin(objects, ", "));
  terms += Term("Speeds", speeds.empty() ? "" : absl::StrCat(absl::StrJoin(speeds, ", "), " mm/s"));
  terms += Term(scale.pictures() ? "Noise floor per pixel" : "Noise floor per finger", Floors(data));
  terms += Term("Mean residual of each finger", FingerBiasWords(data));
  if (set.missed_contacts() > 0) terms += Term("Fingers that reported nothing", Count(set.missed_contacts()));
  if (data.set_aside().outliers() > 0) terms += Term("Outliers", Count(data.set_aside().outliers()));
  return terms.empty() ? "" : absl::StrCat("<dl>", terms, "</dl>\n");
}

std::string Unused(const v1::DataReport& data) {
  if (data.set_aside().rows().empty()) return "";
  std::string table = absl::StrCat("<h3>Rows not used</h3>\n<div class=\"scroll\"><table>",
                                   HeaderRow({">Rows", "Why", "Touch numbers"}), "<tbody>");
  for (const v1::UnusedRows& unused : data.set_aside().rows()) {
    absl::StrAppend(
        &table, "<tr>", NumberCell(Count(unused.rows())), Cell(Typeset(unused.reason())),
        Cell(absl::StrCat(absl::StrJoin(unused.examples(), ", "),
                          unused.rows() > static_cast<uint32_t>(unused.examples_size()) ? ", \u2026" : "")),
        "</tr>");
  }
  return table + "</tbody></table></div>\n";
}

std::string WorstTouches(const v1::DataReport& data) {
  if (data.worst_touches().empty()) return "";
  const ErrorScale scale(data);
  std::vector<std::string> titles = {">Touch", "Object", ">Size"};
  int fingers = 0;
  for (const v1::TouchError& touch : data.worst_touches()) fingers = std::max(fingers, touch.residual_size());
  for (int i = 0; i < fingers; ++i) titles.push_back(absl::StrCat(">finger ", FingerName(data, i)));
  std::string table = absl::StrCat("<div class=\"scroll\"><table>", HeaderRow(titles), "<tbody>");
  for (const v1::TouchError& touch : data.worst_touches()) {
    absl::StrAppend(&table, "<tr>", NumberCell(absl::StrCat(touch.touch())), Cell(Escape(touch.object())),
                    NumberCell(scale.Text(touch.norm())));
    for (int i = 0; i < fingers; ++i) {
      const double residual = i < touch.residual_size() ? touch.residual(i) : std::nan("");
      table += std::isnan(residual) ? Cell("none", "num dim") : NumberCell(scale.Signed(residual));
    }
    table += "</tr>\n";
  }
  return absl::StrCat("<h3>Worst touches</h3>\n",
                      Figure(table + "</tbody></table></div>",
                             "The given model\u2019s residuals per finger, and their size over the touch: "
                             "the square root of the sum of squares."));
}

}  // namespace

std::string HtmlData(const v1::Report& report) {
  const std::string body = PerKind(report, [&](const v1::DataReport& data) {
    return absl::StrCat(Summary(data), Unused(data), WorstTouches(data));
  });
  return Section("data", "The data", "", body);
}

std::string HtmlMethods(const v1::Report& report) {
  const v1::DataReport& data = MainData(report);
  if (data.kind() == v1::DataReport::PHOTOGRAPHS) return HtmlPhotographMethods(report);
  if (!(data.initial().rmse() > 0)) return "";
  return Section(
      "methods", "How the numbers were computed", "",
      "<dl><dt>Residual</dt><dd>Measured minus simulated contact times of the same commanded touch, less the "
      "mean over the fingers that reported: only differences between fingers are measured.</dd>"
      "<dt>RMSE</dt><dd>Square root of the sum of squared residuals over the sum of (reporting fingers "
      "\u2212 "
      "1). For a perfect model it equals the noise of one finger.</dd>"
      "<dt>Noise floor</dt><dd>The same quantity among repeats of the same commanded touch; without repeats "
      "an upper bound from the best model\u2019s residuals.</dd>"
      "<dt>Excess error</dt><dd>The mean square error beyond the noise floor\u2019s.</dd>"
      "<dt>Unseen touches</dt><dd>Touches left out of a fit that is made anew without them: each object in "
      "turn, each fifth of the poses, each fifth of the session; of the three the largest error. For "
      "candidates "
      "objects, or poses where there are few objects, and one linear step instead of a new fit.</dd>"
      "<dt>Lack-of-fit p</dt><dd>Probability of at least this much misfit beyond the scatter of repeats if "
      "nothing were missing.</dd>"
      "<dt>Probability of an effect</dt><dd>Of being the one that is missing, among all effects that could "
      "take its place.</dd>"
      "<dt>Mean residual</dt><dd>Positive: the real contact comes later than the model says.</dd></dl>\n");
}

}  // namespace touchstone::client
