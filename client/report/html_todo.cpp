// What to do: the effects to add, the values to change, the improved model.
#include <algorithm>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/next_commands.h"
#include "client/report/svg_chart.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

std::string Before(const v1::ParameterValue& parameter) {
  if (!parameter.has_before()) return "";
  v1::ParameterValue before;
  before.set_value(parameter.before());
  before.set_unit(parameter.unit());
  return ValueWithError(before);
}

template <typename Parameters>
std::string ParameterTable(const Parameters& parameters) {
  if (parameters.empty()) return "";
  const bool changed =
      std::any_of(parameters.begin(), parameters.end(), [](const auto& p) { return p.has_before(); });
  std::vector<std::string> titles = {"Parameter"};
  if (changed) titles.push_back(">in the model");
  titles.insert(titles.end(), {">value \u00b1 standard error", ">95 % interval", ""});
  std::string table = absl::StrCat("<div class=\"scroll\"><table>", HeaderRow(titles), "<tbody>");
  for (const v1::ParameterValue& parameter : parameters) {
    absl::StrAppend(&table, "<tr>", Cell(Escape(ParameterName(parameter))));
    if (changed) table += NumberCell(Before(parameter));
    absl::StrAppend(&table, NumberCell(ValueWithError(parameter)), NumberCell(Interval(parameter)),
                    Cell(IntervalPicture(parameter)), "</tr>");
  }
  return table + "</tbody></table></div>";
}

std::string Item(int number, const std::string& title, const std::string& body) {
  return absl::StrCat("<li><span class=\"count\">", number, "</span><div><h3>", title, "</h3>", body,
                      "</div></li>\n");
}

std::string Definition(const char* term, const std::string& text) {
  return text.empty() ? "" : absl::StrCat("<dt>", term, "</dt><dd>", Typeset(text), "</dd>");
}

std::string StepBody(const v1::Step& step) {
  std::string body;
  if (!step.meaning().empty()) absl::StrAppend(&body, "<p>", Typeset(step.meaning()), "</p>");
  if (!step.words().empty()) absl::StrAppend(&body, "<p>", Typeset(step.words()), "</p>");
  if (!step.equivalent().empty()) {
    std::vector<std::string> equivalent = {step.effect()};
    equivalent.insert(equivalent.end(), step.equivalent().begin(), step.equivalent().end());
    absl::StrAppend(&body, "<p>These data cannot tell ", Escape(Join(equivalent, "and")), " apart.</p>");
  }
  std::string terms = absl::StrCat(Definition("To decide", step.discriminating_measurement()),
                                   Definition("To check on the rig", step.check_on_rig()),
                                   Definition("To fix it", step.remedy()));
  if (step.scope().kind() == v1::Scope::OBJECT) terms += Definition("Scope", "one value per object");
  if (step.probability() > 0) {
    const std::string p = EffectProbability(step.probability());
    terms += Definition("Probability",
                        step.equivalent().empty()
                            ? absl::StrCat(p, " among all effects that could take its place")
                            : absl::StrCat(p, " that it is one of these ", 1 + step.equivalent_size(),
                                           ", among all effects that could take their place"));
  }
  return absl::StrCat(body, ParameterTable(step.parameters()),
                      terms.empty() ? "" : absl::StrCat("<dl>", terms, "</dl>"));
}

}  // namespace

std::string HtmlWhatToDo(const v1::Report& report) {
  std::string items;
  int number = 0;
  for (const v1::Refit& refit : report.refitted()) {
    items +=
        Item(++number, absl::StrCat("Change ", Escape(refit.effect())), ParameterTable(refit.parameters()));
  }
  for (const v1::Step& step : report.steps()) {
    items += Item(++number, absl::StrCat("Add ", Escape(StepName(step))), StepBody(step));
  }
  std::string body = items.empty() ? "" : absl::StrCat("<ol class=\"steps\">", items, "</ol>\n");
  if (!report.improved_model_yaml().empty()) {
    absl::StrAppend(
        &body,
        "<h3>The improved model</h3>\n<div class=\"row\"><button type=\"button\" data-copy=\"model\">"
        "Copy</button>",
        report.improved_model_hash().empty()
            ? ""
            : absl::StrCat("<span>hash <code title=\"", Escape(report.improved_model_hash()), "\">",
                           Escape(report.improved_model_hash().substr(0, 12)), "</code></span>"),
        "</div>\n<pre id=\"model\">", Escape(report.improved_model_yaml()), "</pre>\n");
  }
  int command = 0;
  for (const NextCommand& next : NextCommands(report)) {
    const std::string id = absl::StrCat("next", ++command);
    absl::StrAppend(
        &body, "<h3>", Escape(next.purpose), "</h3>\n<div class=\"row\"><button type=\"button\" data-copy=\"",
        id, "\">Copy</button></div>\n<pre class=\"wrap\" id=\"", id, "\">", Escape(next.command), "</pre>\n");
  }
  return Section("todo", "What to do", "", body);
}

}  // namespace touchstone::client
