#include "client/report/joint.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <vector>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"

namespace touchstone::client {
namespace {

struct JointRung {
  std::string name, touches, photographs, shown_by;
};

std::string ShownBy(const std::string& kind) {
  return kind == "both" ? "both" : kind.empty() ? "" : absl::StrCat(kind, " alone");
}

std::vector<JointRung> RungsOfBoth(const v1::Report& report) {
  const ErrorScale grey(report);
  std::vector<JointRung> rungs = {
      {"given model", Time(report.initial().rmse_us()), grey.Text(report.initial().rmse_grey()), ""}};
  for (const v1::Step& step : report.steps())
    rungs.push_back({absl::StrCat("+ ", StepName(step)), Time(step.rmse_us()), grey.Text(step.rmse_grey()),
                     ShownBy(step.shown_by())});
  if (report.noise_floor_us() > 0 && report.noise_floor_grey() > 0)
    rungs.push_back({"noise floor", Time(report.noise_floor_us()), grey.Text(report.noise_floor_grey()), ""});
  return rungs;
}

struct JointValue {
  std::string name, value, touches, photographs;
};

template <typename Message>
void AddValues(const Message& message, std::vector<JointValue>* values) {
  for (const v1::ParameterValue& p : message.parameters()) {
    if (!p.has_std_error_touches() && !p.has_std_error_photographs()) continue;
    const std::string unit = p.unit().empty() ? "" : absl::StrCat(" ", p.unit());
    const auto alone = [&](bool has, double error) {
      return has ? absl::StrCat("+- ", Number(error, 2), unit) : "says nothing";
    };
    values->push_back({absl::StrCat(message.effect(), " ", p.name(), p.finger().empty() ? "" : " ",
                                    p.finger(), p.object().empty() ? "" : " of ", p.object()),
                       absl::StrCat(Number(p.value(), 4), " +- ", Number(p.std_error(), 2), unit),
                       alone(p.has_std_error_touches(), p.std_error_touches()),
                       alone(p.has_std_error_photographs(), p.std_error_photographs())});
  }
}

std::vector<JointValue> ValuesOfBoth(const v1::Report& report) {
  std::vector<JointValue> values;
  for (const v1::Refit& refit : report.refitted()) AddValues(refit, &values);
  for (const v1::Step& step : report.steps()) AddValues(step, &values);
  return values;
}

}  // namespace

bool IsJoint(const v1::Report& report) {
  return report.initial().rmse_us() > 0 && report.initial().rmse_grey() > 0;
}

std::string FallsOfBoth(const v1::Report& report) {
  const ErrorScale grey(report);
  std::vector<std::string> falls;
  const double from_us = report.initial().rmse_us(), to_us = report.final().rmse_us();
  if (to_us > 0 && to_us < from_us && Time(to_us) != Time(from_us))
    falls.push_back(absl::StrCat("from ", Time(from_us), " to ", Time(to_us), " on touches"));
  const double from = report.initial().rmse_grey(), to = report.final().rmse_grey();
  if (to > 0 && to < from && grey.Text(to) != grey.Text(from))
    falls.push_back(absl::StrCat("from ", grey.Text(from), " to ", grey.Text(to), " on pictures"));
  return falls.empty() ? "" : absl::StrCat("falls ", absl::StrJoin(falls, " and "));
}

void AddJoint(const v1::Report& report, TextLayout* out) {
  if (!IsJoint(report)) return;
  using Cell = TextLayout::Cell;
  std::vector<std::vector<Cell>> rows = {{{""},
                                          {"touches", true, TextLayout::kDim},
                                          {"pictures", true, TextLayout::kDim},
                                          {"shown by", false, TextLayout::kDim}}};
  for (const JointRung& rung : RungsOfBoth(report))
    rows.push_back({{rung.name}, {rung.touches, true}, {rung.photographs, true}, {rung.shown_by}});
  out->Label("Both");
  out->Rows(rows);
  const std::vector<JointValue> values = ValuesOfBoth(report);
  if (!values.empty()) {
    rows = {{{""},
             {"both", true, TextLayout::kDim},
             {"touches alone", true, TextLayout::kDim},
             {"pictures alone", true, TextLayout::kDim}}};
    for (const JointValue& value : values)
      rows.push_back({{value.name}, {value.value, true}, {value.touches, true}, {value.photographs, true}});
    out->Rows(rows);
  }
  // A comparison has no more to say of both.
  if (report.verdict() != v1::Report::VERDICT_UNSPECIFIED) out->Paragraph(report.summary());
}

std::string HtmlJoint(const v1::Report& report) {
  if (!IsJoint(report)) return "";
  std::string ladder = absl::StrCat("<table class=\"narrow\">",
                                    HeaderRow({"", ">Touches", ">Pictures", "Shown by"}), "<tbody>");
  for (const JointRung& rung : RungsOfBoth(report))
    absl::StrAppend(&ladder, "<tr>", Cell(Escape(rung.name)), NumberCell(rung.touches),
                    NumberCell(rung.photographs), Cell(Escape(rung.shown_by)), "</tr>\n");
  std::string body =
      Figure(absl::StrCat(ladder, "</tbody></table>"),
             "RMSE of both kinds of data after each step, as comparisons with that model find it.");
  const std::vector<JointValue> values = ValuesOfBoth(report);
  if (!values.empty()) {
    std::string table =
        absl::StrCat("<div class=\"scroll\"><table>",
                     HeaderRow({"Value", ">From both", ">Touches alone", ">Pictures alone"}), "<tbody>");
    for (const JointValue& value : values)
      absl::StrAppend(&table, "<tr>", Cell(Escape(value.name)), NumberCell(value.value),
                      NumberCell(value.touches), NumberCell(value.photographs), "</tr>\n");
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
