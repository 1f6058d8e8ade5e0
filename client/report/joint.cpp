#include "client/report/joint.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <vector>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"

namespace touchstone::client {
namespace {

// A line of the ladder: an error of each kind of measurement.
struct JointRung {
  std::string name;
  std::vector<std::string> errors;
  std::string shown_by;
};

std::string ShownBy(const v1::Step& step) {
  if (step.shown_by_size() > 1) return "both";
  return step.shown_by().empty() ? "" : absl::AsciiStrToLower(KindName(step.shown_by(0))) + " alone";
}

template <typename Error>
JointRung RungOf(const v1::Report& report, std::string name, const Error& error_of,
                 std::string shown_by = "") {
  JointRung rung{std::move(name), {}, std::move(shown_by)};
  for (const v1::DataReport& data : report.data())
    rung.errors.push_back(ErrorScale(data).Text(error_of(data)));
  return rung;
}

std::vector<JointRung> RungsOfBoth(const v1::Report& report) {
  std::vector<JointRung> rungs = {
      RungOf(report, "given model", [](const v1::DataReport& data) { return data.initial().rmse(); })};
  for (int i = 0; i < report.steps_size(); ++i)
    rungs.push_back(RungOf(
        report, absl::StrCat("+ ", StepName(report.steps(i))),
        [i](const v1::DataReport& data) {
          return i < data.after_step_size() ? data.after_step(i).rmse() : 0;
        },
        ShownBy(report.steps(i))));
  const auto has_floor = [](const v1::DataReport& data) { return data.noise_floor() > 0; };
  if (std::all_of(report.data().begin(), report.data().end(), has_floor))
    rungs.push_back(
        RungOf(report, "noise floor", [](const v1::DataReport& data) { return data.noise_floor(); }));
  return rungs;
}

struct JointValue {
  std::string name, value;
  std::vector<std::string> alone;  // of each kind
};

template <typename Message>
void AddValues(const v1::Report& report, const Message& message, std::vector<JointValue>* values) {
  for (const v1::ParameterValue& p : message.parameters()) {
    if (p.alone().empty()) continue;
    const std::string unit = p.unit().empty() ? "" : absl::StrCat(" ", p.unit());
    JointValue value{absl::StrCat(message.effect(), " ", p.name(), p.finger().empty() ? "" : " ", p.finger(),
                                  p.object().empty() ? "" : " of ", p.object()),
                     absl::StrCat(Number(p.value(), 4), " +- ", Number(p.std_error(), 2), unit),
                     {}};
    for (const v1::DataReport& data : report.data()) {
      const auto own = std::find_if(p.alone().begin(), p.alone().end(),
                                    [&](const v1::ErrorAlone& one) { return one.kind() == data.kind(); });
      value.alone.push_back(own == p.alone().end() ? "says nothing"
                                                   : absl::StrCat("+- ", Number(own->std_error(), 2), unit));
    }
    values->push_back(std::move(value));
  }
}

std::vector<JointValue> ValuesOfBoth(const v1::Report& report) {
  std::vector<JointValue> values;
  for (const v1::Refit& refit : report.refitted()) AddValues(report, refit, &values);
  for (const v1::Step& step : report.steps()) AddValues(report, step, &values);
  return values;
}

}  // namespace

std::string FallsOfBoth(const v1::Report& report) {
  std::vector<std::string> falls;
  for (const v1::DataReport& data : report.data()) {
    const ErrorScale scale(data);
    const double from = data.initial().rmse(), to = data.final().rmse();
    if (to > 0 && to < from && scale.Text(to) != scale.Text(from))
      falls.push_back(
          absl::StrCat("from ", scale.Text(from), " to ", scale.Text(to), " on ", scale.readings()));
  }
  return falls.empty() ? "" : absl::StrCat("falls ", absl::StrJoin(falls, " and "));
}

void AddJoint(const v1::Report& report, TextLayout* out) {
  if (!IsJoint(report)) return;
  using Cell = TextLayout::Cell;
  std::vector<std::vector<Cell>> rows(1), values(1);
  rows[0] = {{""}};
  values[0] = {{""}, {"both", true, TextLayout::kDim}};
  for (const v1::DataReport& data : report.data()) {
    rows[0].push_back({ErrorScale(data).readings(), true, TextLayout::kDim});
    values[0].push_back({absl::StrCat(ErrorScale(data).readings(), " alone"), true, TextLayout::kDim});
  }
  rows[0].push_back({"shown by", false, TextLayout::kDim});
  for (const JointRung& rung : RungsOfBoth(report)) {
    rows.push_back({{rung.name}});
    for (const std::string& error : rung.errors) rows.back().push_back({error, true});
    rows.back().push_back({rung.shown_by});
  }
  out->Label("Both");
  out->Rows(rows);
  for (const JointValue& value : ValuesOfBoth(report)) {
    values.push_back({{value.name}, {value.value, true}});
    for (const std::string& alone : value.alone) values.back().push_back({alone, true});
  }
  if (values.size() > 1) out->Rows(values);
  // A comparison has no more to say of both.
  if (report.verdict() != v1::Report::VERDICT_UNSPECIFIED) out->Paragraph(report.summary());
}

std::string HtmlJoint(const v1::Report& report) {
  if (!IsJoint(report)) return "";
  std::vector<std::string> rung_titles = {""}, value_titles = {"Value", ">From both"};
  for (const v1::DataReport& data : report.data()) {
    std::string readings = ErrorScale(data).readings();
    readings[0] = absl::ascii_toupper(readings[0]);
    rung_titles.push_back(absl::StrCat(">", readings));
    value_titles.push_back(absl::StrCat(">", readings, " alone"));
  }
  rung_titles.push_back("Shown by");
  const auto row = [](const std::string& name, const std::vector<std::string>& numbers,
                      const std::string& last) {
    std::string html = absl::StrCat("<tr>", Cell(Escape(name)));
    for (const std::string& number : numbers) html += NumberCell(number);
    return absl::StrCat(html, last, "</tr>\n");
  };
  std::string ladder = absl::StrCat("<table class=\"narrow\">", HeaderRow(rung_titles), "<tbody>");
  for (const JointRung& rung : RungsOfBoth(report))
    ladder += row(rung.name, rung.errors, Cell(Escape(rung.shown_by)));
  std::string body =
      Figure(absl::StrCat(ladder, "</tbody></table>"),
             "RMSE of both kinds of data after each step, as comparisons with that model find it.");
  const std::vector<JointValue> values = ValuesOfBoth(report);
  if (!values.empty()) {
    std::string table = absl::StrCat("<div class=\"scroll\"><table>", HeaderRow(value_titles), "<tbody>");
    for (const JointValue& value : values) {
      std::vector<std::string> numbers = {value.value};
      numbers.insert(numbers.end(), value.alone.begin(), value.alone.end());
      table += row(value.name, numbers, "");
    }
    body += Figure(
        absl::StrCat(table, "</tbody></table></div>"),
        "Fitted to the sum of both log likelihoods. Alone: the standard error that either kind of data would "
        "leave by itself.");
  }
  return Section("both", "Touches and pictures",
                 "What both kinds of data show together, and what only one of them shows.",
                 absl::StrCat(body, report.verdict() == v1::Report::VERDICT_UNSPECIFIED
                                        ? ""
                                        : absl::StrCat("<p>", Typeset(report.summary()), "</p>\n")));
}

}  // namespace touchstone::client
