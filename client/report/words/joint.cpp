#include "client/report/words/joint.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <vector>

#include "client/report/words/error_scale.h"

namespace touchstone::client {
namespace {

// A table with a column per kind of measurement; `text_last`: the last column is no number.
struct JointTable {
  std::vector<std::string> titles;
  std::vector<std::vector<std::string>> rows;
  bool text_last = false;
  bool IsText(size_t column) const { return column == 0 || (text_last && column + 1 == titles.size()); }
};

std::string ShownBy(const v1::Step& step) {
  if (step.shown_by_size() > 1) return "both";
  return step.shown_by().empty() ? "" : absl::AsciiStrToLower(KindName(step.shown_by(0))) + " alone";
}

// Errors after each step.
JointTable LadderOfBoth(const v1::Report& report) {
  JointTable table{{""}, {}, true};
  const auto add = [&](const std::string& name, const auto& error_of, const std::string& shown_by) {
    std::vector<std::string>& row = table.rows.emplace_back(1, name);
    for (const v1::DataReport& data : report.data()) row.push_back(ErrorScale(data).Text(error_of(data)));
    row.push_back(shown_by);
  };
  for (const v1::DataReport& data : report.data()) table.titles.push_back(ErrorScale(data).readings());
  table.titles.push_back("shown by");
  add(
      "given model", [](const v1::DataReport& data) { return data.initial().rmse(); }, "");
  for (int i = 0; i < report.steps_size(); ++i)
    add(
        absl::StrCat("+ ", StepName(report.steps(i))),
        [i](const v1::DataReport& data) {
          return i < data.after_step_size() ? data.after_step(i).rmse() : 0;
        },
        ShownBy(report.steps(i)));
  if (std::all_of(report.data().begin(), report.data().end(),
                  [](const v1::DataReport& data) { return data.noise_floor() > 0; }))
    add(
        "noise floor", [](const v1::DataReport& data) { return data.noise_floor(); }, "");
  return table;
}

// Values that both kinds show, with the standard errors that each alone would give.
JointTable ValuesOfBoth(const v1::Report& report) {
  JointTable table{{"", "from both"}, {}};
  for (const v1::DataReport& data : report.data())
    table.titles.push_back(absl::StrCat(ErrorScale(data).readings(), " alone"));
  const auto add = [&](const auto& message) {
    for (const v1::ParameterValue& p : message.parameters()) {
      if (p.alone().empty()) continue;
      std::vector<std::string>& row = table.rows.emplace_back();
      row = {absl::StrCat(message.effect(), " ", p.name(), p.finger().empty() ? "" : " ", p.finger(),
                          p.object().empty() ? "" : " of ", p.object()),
             ValueWithError(p)};
      for (const v1::DataReport& data : report.data()) {
        const auto own = std::find_if(p.alone().begin(), p.alone().end(),
                                      [&](const v1::ErrorAlone& one) { return one.kind() == data.kind(); });
        row.push_back(own == p.alone().end() ? "says nothing"
                                             : absl::StrCat("+- ", SizeInUnit(own->std_error(), p.unit())));
      }
    }
  };
  for (const v1::Refit& refit : report.refitted()) add(refit);
  for (const v1::Step& step : report.steps()) add(step);
  return table;
}

void AddTable(const JointTable& table, TextLayout* out) {
  std::vector<std::vector<TextLayout::Cell>> rows(1);
  for (size_t i = 0; i < table.titles.size(); ++i)
    rows[0].push_back({table.titles[i], !table.IsText(i), TextLayout::kDim});
  for (const std::vector<std::string>& row : table.rows) {
    rows.emplace_back();
    for (size_t i = 0; i < row.size(); ++i) rows.back().push_back({row[i], !table.IsText(i)});
  }
  out->Rows(rows);
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
  out->Label("Both");
  AddTable(LadderOfBoth(report), out);
  const JointTable values = ValuesOfBoth(report);
  if (!values.rows.empty()) AddTable(values, out);
  // A comparison has no more to say of both.
  if (report.verdict() != v1::Report::VERDICT_UNSPECIFIED) out->Paragraph(report.summary());
}

}  // namespace touchstone::client
