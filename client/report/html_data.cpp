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

std::string Floors(const v1::Report& report) {
  const Floor floor = NoiseFloorOf(report);
  if (!(floor.sigma > 0)) return "";
  const ErrorScale scale(report);
  std::string text = absl::StrCat(floor.bound ? "at most " : "", scale.Text(floor.sigma));
  const v1::NoiseFloor& detail = report.noise_floor();
  const double lower = scale.grey() ? detail.lower_grey() : detail.lower_us();
  const double upper = scale.grey() ? detail.upper_grey() : detail.upper_us();
  if (lower > 0 && lower < upper)
    absl::StrAppend(&text, ", 95 % interval ", scale.Text(lower), " to ", scale.Text(upper));
  absl::StrAppend(&text,
                  floor.bound ? ", from the best model\u2019s residuals" : ", from repeats of the same ",
                  floor.bound ? "" : scale.one_reading());
  if (detail.degrees_of_freedom() > 0) {
    absl::StrAppend(&text, ", ", Count(detail.degrees_of_freedom()), " degrees of freedom");
  }
  return text;
}

std::string Summary(const v1::Report& report) {
  const v1::DataSummary& data = report.data();
  std::vector<std::string> objects(data.objects().begin(), data.objects().end()), speeds, fingers;
  for (const double speed : data.speeds_mm_s()) speeds.push_back(Tick(speed));
  for (int i = 0; i < report.finger_bias_us_size(); ++i) {
    fingers.push_back(absl::StrCat(FingerName(report, i), " ", SignedTime(report.finger_bias_us(i))));
  }
  std::string terms;
  if (data.rows() > 0) {
    terms += Term("Rows in the file",
                  absl::StrCat(Count(data.rows()), ", of which ",
                               Count(report.touches() > 0 ? report.touches() : report.images()), " used"));
  }
  terms += Term("Objects", absl::StrJoin(objects, ", "));
  terms += Term("Speeds", speeds.empty() ? "" : absl::StrCat(absl::StrJoin(speeds, ", "), " mm/s"));
  terms +=
      Term(ErrorScale(report).grey() ? "Noise floor per pixel" : "Noise floor per finger", Floors(report));
  terms += Term("Mean residual of each finger", absl::StrJoin(fingers, ", "));
  if (data.missed_contacts() > 0)
    terms += Term("Fingers that reported nothing", Count(data.missed_contacts()));
  if (data.outliers() > 0) terms += Term("Outliers", Count(data.outliers()));
  return terms.empty() ? "" : absl::StrCat("<dl>", terms, "</dl>\n");
}

std::string Unused(const v1::Report& report) {
  if (report.data().unused().empty()) return "";
  std::string table = absl::StrCat("<h3>Rows not used</h3>\n<div class=\"scroll\"><table>",
                                   HeaderRow({">Rows", "Why", "Touch numbers"}), "<tbody>");
  for (const v1::UnusedRows& unused : report.data().unused()) {
    absl::StrAppend(
        &table, "<tr>", NumberCell(Count(unused.rows())), Cell(Typeset(unused.reason())),
        Cell(absl::StrCat(absl::StrJoin(unused.examples(), ", "),
                          unused.rows() > static_cast<uint32_t>(unused.examples_size()) ? ", \u2026" : "")),
        "</tr>");
  }
  return table + "</tbody></table></div>\n";
}

std::string WorstTouches(const v1::Report& report) {
  if (report.worst_touches().empty()) return "";
  std::vector<std::string> titles = {">Touch", "Object", ">Size"};
  int fingers = 0;
  for (const v1::TouchError& touch : report.worst_touches())
    fingers = std::max(fingers, touch.residual_us_size());
  for (int i = 0; i < fingers; ++i) titles.push_back(absl::StrCat(">finger ", FingerName(report, i)));
  std::string table = absl::StrCat("<div class=\"scroll\"><table>", HeaderRow(titles), "<tbody>");
  for (const v1::TouchError& touch : report.worst_touches()) {
    absl::StrAppend(&table, "<tr>", NumberCell(absl::StrCat(touch.touch())), Cell(Escape(touch.object())),
                    NumberCell(Time(touch.norm_us())));
    for (int i = 0; i < fingers; ++i) {
      const double residual = i < touch.residual_us_size() ? touch.residual_us(i) : std::nan("");
      table += std::isnan(residual) ? Cell("none", "num dim") : NumberCell(SignedTime(residual));
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
  return Section("data", "The data", "", absl::StrCat(Summary(report), Unused(report), WorstTouches(report)));
}

std::string HtmlMethods(const v1::Report& report) {
  if (report.images() > 0) return HtmlPhotographMethods(report);
  if (!(report.initial().rmse_us() > 0)) return "";
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
