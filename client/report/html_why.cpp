// Why: every effect of the catalogue as the one that is missing, and which of them these data cannot tell
// apart; where no effect explains the rest, what it depends on.
#include <cmath>
#include <map>
#include <set>

#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/svg_chart.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

constexpr int kMaxCandidateParameters = 4;  // of a candidate

// "offset_mm l", "relative lat10".
std::string ShortName(const v1::ParameterValue& parameter) {
  return absl::StrCat(parameter.name(), parameter.finger().empty() ? "" : " ", parameter.finger(),
                      parameter.object().empty() ? "" : " ", parameter.object());
}

// Effects without a fit, by the reason why there is none.
std::string NotFitted(const v1::Report& report) {
  std::vector<std::string> notes;
  std::map<std::string, std::vector<std::string>> effects;
  for (const v1::Candidate& candidate : report.candidates()) {
    if (candidate.rmse_us() > 0 || candidate.note().empty()) continue;
    std::vector<std::string>& names = effects[candidate.note()];
    if (names.empty()) notes.push_back(candidate.note());
    names.push_back(absl::StrCat(candidate.effect(), candidate.scope() == "object" ? " (per object)" : ""));
  }
  std::string items;
  for (const std::string& note : notes) {
    absl::StrAppend(&items, "<dt>", Escape(Join(effects[note], "and")), "</dt><dd>", Typeset(note), "</dd>");
  }
  return items.empty() ? "" : absl::StrCat("<dl class=\"rest\">", items, "</dl>\n");
}

// Value and picture of each parameter, one line each.
template <typename Parameters>
std::string ParameterCells(const Parameters& parameters) {
  std::string names, pictures;
  const int shown =
      parameters.size() > kMaxCandidateParameters ? kMaxCandidateParameters - 1 : parameters.size();
  for (int i = 0; i < shown; ++i) {
    const v1::ParameterValue& parameter = parameters[i];
    const std::string interval = Interval(parameter);
    absl::StrAppend(&names, "<div",
                    interval.empty() ? "" : absl::StrCat(" title=\"95 % interval ", Escape(interval), "\""),
                    "><span class=\"dim\">", Escape(ShortName(parameter)), "</span> ",
                    Typeset(ValueWithError(parameter)), "</div>");
    absl::StrAppend(&pictures, "<div class=\"line-high\">", IntervalPicture(parameter), "</div>");
  }
  if (shown < parameters.size())
    absl::StrAppend(&names, "<div class=\"dim\">", parameters.size() - shown, " more</div>");
  return Cell(names) + Cell(pictures, "pictures");
}

std::string CandidateTable(const v1::Report& report) {
  if (report.candidates().empty()) return "";
  const double initial = UnseenError(report.initial().heldout_rmse_us(), report.initial().rmse_us());
  const double floor = NoiseFloorOf(report).sigma_us;
  double largest = initial;
  for (const v1::Candidate& c : report.candidates())
    largest = std::max(largest, UnseenError(c.heldout_rmse_us(), c.rmse_us()));
  std::string table = absl::StrCat("<div class=\"scroll\"><table class=\"why\">",
                                   HeaderRow({"Effect", ">Probability", ">It would leave", "",
                                              "Parameter \u00b1 standard error", "95 % interval"}),
                                   "<tbody>");
  for (const v1::Candidate& candidate : report.candidates()) {
    if (!(candidate.rmse_us() > 0) && !candidate.note().empty()) continue;
    const double left = UnseenError(candidate.heldout_rmse_us(), candidate.rmse_us());
    const double p = candidate.probability();
    absl::StrAppend(
        &table, p < 0.05 ? "<tr class=\"dim\">" : "<tr>",
        Cell(absl::StrCat("<span class=\"name\">", Escape(candidate.effect()), "</span>",
                          candidate.scope() == "object" ? "<br><small>a value per object</small>" : "")),
        NumberCell(EffectProbability(p)), NumberCell(left > 0 ? Time(left) : ""),
        Cell(left > 0 ? Bar(left / largest, p < 0.05 ? "share" : "better", floor > 0 ? floor / largest : -1)
                      : "",
             "barcell"));
    if (candidate.note().empty()) {
      table += ParameterCells(candidate.parameters());
    } else {
      absl::StrAppend(&table, "<td colspan=\"2\">", Typeset(candidate.note()), "</td>");
    }
    table += "</tr>\n";
  }
  return Figure(absl::StrCat(table, "</tbody></table></div>"),
                "Each effect alone, as the first to be added. It would leave: the RMSE on touches left out "
                "of the fit, dashed the noise floor. Intervals: 95 %, the upright line is zero, no effect.") +
         NotFitted(report);
}

std::string Ambiguities(const v1::Report& report) {
  std::string items;
  for (const v1::Ambiguity* ambiguity : OtherAmbiguities(report)) {
    const std::vector<std::string> effects(ambiguity->effects().begin(), ambiguity->effects().end());
    absl::StrAppend(&items, "<dt class=\"name\">", Escape(Join(effects, "or")), "</dt><dd>",
                    Typeset(ToDecide(ambiguity->discriminating_measurement())), "</dd>");
  }
  if (items.empty()) return "";
  return absl::StrCat("<h3>What these data cannot tell apart</h3>\n<dl>", items, "</dl>\n");
}

}  // namespace

std::string HtmlWhy(const v1::Report& report) {
  return Section("why", "Why",
                 "Every effect of the catalogue, fitted and judged on touches that the fit did not see.",
                 absl::StrCat(CandidateTable(report), Ambiguities(report)));
}

std::string HtmlUnexplained(const v1::Report& report) {
  const v1::Unexplained& rest = report.unexplained();
  std::string body;
  if (!rest.covariates().empty()) {
    body = absl::StrCat("<div class=\"scroll\"><table>",
                        HeaderRow({"The rest depends on", ">p", ">gain in log evidence (nats)"}), "<tbody>");
    for (const v1::CovariateTest& test : rest.covariates()) {
      absl::StrAppend(&body, "<tr>", Cell(Escape(test.name()), "name"), NumberCell(Probability(test.p())),
                      NumberCell(Number(test.gain_nats())), "</tr>");
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
    if (rest.heldout_rmse_us() > 0) {
      absl::StrAppend(&body, "<dt>It would leave</dt><dd>", Typeset(Time(rest.heldout_rmse_us())),
                      " on touches left out of the fit; it removes ", Typeset(Share(rest.heldout_gain())),
                      " of the excess error there</dd>");
    }
    if (!rest.nearest_effect().empty()) {
      absl::StrAppend(&body, "<dt>Looks most like</dt><dd>", Escape(rest.nearest_effect()), " (cosine ",
                      Typeset(Fixed(rest.nearest_cosine(), 2)),
                      " between the two; 1 would be the same)</dd>");
    }
    body += "</dl>\n";
  }
  if (!rest.formula_yaml().empty()) {
    absl::StrAppend(&body,
                    "<h3>To add it, under <code>effects</code> in the model file</h3>\n"
                    "<div class=\"row\"><button type=\"button\" data-copy=\"formula\">Copy</button></div>\n"
                    "<pre id=\"formula\">",
                    Escape(rest.formula_yaml()), "</pre>\n");
  }
  return Section(
      "unexplained", "What no built-in effect explains",
      "A structure that is left after all steps. p: likelihood ratio of the best term, all terms paid for.",
      body);
}

}  // namespace touchstone::client
