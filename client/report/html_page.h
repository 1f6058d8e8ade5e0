// Pieces of the HTML report. Each Html* function gives one section, empty if the report has nothing for it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/strings/string_view.h>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

// & < > " ' as entities; control characters dropped. All text that comes from the report passes through here
// or through Typeset.
std::string Escape(absl::string_view text);

// Escape, then our numbers in type: +- as a plus-minus sign, us as microseconds, -3 with a minus sign, 3e-9
// as a power of ten, spaces before units unbreakable.
std::string Typeset(absl::string_view text);

// <section> with a heading and a line that says what is shown; empty if `body` is.
std::string Section(absl::string_view id, absl::string_view title, absl::string_view lead,
                    absl::string_view body);

// What `part` gives of each kind of measurement, under its name where there are several.
std::string PerKind(const v1::Report& report,
                    const std::function<std::string(const v1::DataReport& data)>& part);

// <figure> with its caption below; the caption says how the numbers were computed.
std::string Figure(absl::string_view picture, absl::string_view caption, absl::string_view css_class = "");

// A table cell: <td> with text that is already HTML.
std::string Cell(absl::string_view html, absl::string_view css_class = "");
std::string NumberCell(absl::string_view plain);  // typeset, aligned right

// Header row of plain titles; a title that starts with '>' heads a column of numbers.
std::string HeaderRow(const std::vector<std::string>& titles);

// A horizontal bar as a picture, as wide as its place: `share` of the full width, a tick at `mark` (< 0:
// none).
std::string Bar(double share, absl::string_view css_class, double mark = -1);

// The finger's name, or its number if the entry has no names.
std::string FingerName(const v1::DataReport& data, int finger);

// A line of keys for charts: pairs of css class and plain text.
std::string Legend(const std::vector<std::pair<std::string, std::string>>& keys);

const char* HtmlStyle();   // the text of <style>
const char* HtmlScript();  // the text of <script>

std::string HtmlHead(const v1::Report& report);          // verdict, ladder, warnings
std::string HtmlDataProblems(const v1::Report& report);  // mistakes of the file, and what fixes them
std::string HtmlWhatToDo(const v1::Report& report);
std::string HtmlWhy(const v1::Report& report);
std::string HtmlUnexplained(const v1::Report& report);
std::string HtmlWhere(const v1::Report& report);
std::string HtmlPhotographs(const v1::Report& report);  // pictures side by side, outlines, picture by picture
std::string HtmlNextPhotographs(const v1::Report& report);
std::string HtmlPhotographMethods(const v1::Report& report);
std::string HtmlObjects(const v1::Report& report);  // residuals on the surface
std::string HtmlFit(const v1::Report& report);      // parity and histograms
std::string HtmlDistributions(const v1::Report& report);
std::string HtmlNextTouches(const v1::Report& report);  // what to measure next
std::string HtmlData(const v1::Report& report);
std::string HtmlProvenance(const v1::Report& report);
std::string HtmlMethods(const v1::Report& report);  // how the numbers were computed

}  // namespace touchstone::client
