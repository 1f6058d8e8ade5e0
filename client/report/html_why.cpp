// Why: every effect of the catalogue as the one that is missing, and which of them these data cannot tell apart.
#include <cmath>
#include <map>
#include <set>

#include <absl/strings/str_cat.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"
#include "client/report/joint.h"
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

// Where an effect of objects is tried: at one of them, or at each with a value of its own.
std::string ScopeWords(const v1::Candidate& candidate) {
  if (candidate.scope().kind() != v1::Scope::OBJECT) return "";
  if (candidate.scope().objects_size() != 1) return "<br><small>a value per object</small>";
  return absl::StrCat("<br><small>of ", Escape(candidate.scope().objects(0)), " only</small>");
}

// Beside what each effect is tried: candidates of a joint report are ranked with what both kinds of data show in place.
std::string InPlace(const v1::Report& report) {
  std::vector<std::string> shared;
  if (IsJoint(report))
    for (const v1::Step& step : report.steps())
      if (step.shown_by_size() > 1) shared.push_back(step.effect());
  return shared.empty() ? "as the first to be added"
                        : absl::StrCat("with ", Join(shared, "and"), " in place");
}

// A candidate, and the entry in whose unit its errors are.
struct RankedCandidate {
  const v1::Candidate* candidate;
  const v1::DataReport* data;
  double Left() const { return UnseenError(*candidate); }
};

// Of all kinds of measurement.
std::vector<RankedCandidate> Candidates(const v1::Report& report) {
  std::vector<RankedCandidate> ranked;
  for (const v1::DataReport& data : report.data())
    for (const v1::Candidate& candidate : data.candidates()) ranked.push_back({&candidate, &data});
  return ranked;
}

// Effects without a fit, by the reason why there is none.
std::string NotFitted(const v1::Report& report) {
  std::vector<std::string> notes;
  std::map<std::string, std::vector<std::string>> effects;
  for (const RankedCandidate& ranked : Candidates(report)) {
    const v1::Candidate& candidate = *ranked.candidate;
    if (candidate.rmse() > 0 || candidate.note().empty()) continue;
    std::vector<std::string>& names = effects[candidate.note()];
    if (names.empty()) notes.push_back(candidate.note());
    names.push_back(absl::StrCat(candidate.effect(),
                                 candidate.scope().kind() == v1::Scope::OBJECT ? " (per object)" : ""));
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
  const std::vector<RankedCandidate> candidates = Candidates(report);
  if (candidates.empty()) return "";
  // Of each kind's errors the largest is the width of a bar.
  std::map<const v1::DataReport*, double> largest;
  for (const v1::DataReport& data : report.data()) largest[&data] = UnseenError(data.initial());
  for (const RankedCandidate& one : candidates) largest[one.data] = std::max(largest[one.data], one.Left());
  std::string table = absl::StrCat("<div class=\"scroll\"><table class=\"why\">",
                                   HeaderRow({"Effect", ">Probability", ">It would leave", "",
                                              "Parameter \u00b1 standard error", "95 % interval"}),
                                   "<tbody>");
  const bool none = report.verdict() == v1::Report::UNEXPLAINED && report.steps().empty();
  // Equivalents share the probability of their step.
  std::set<std::string> first_step;
  if (!report.steps().empty() && !report.steps(0).equivalent().empty()) {
    first_step.insert(report.steps(0).equivalent().begin(), report.steps(0).equivalent().end());
    first_step.insert(report.steps(0).effect());
  }
  const std::string shared =
      first_step.empty()
          ? ""
          : absl::StrCat(" Effects marked as one of these fit alike and share a probability of ",
                         EffectProbability(report.steps(0).probability()), ".");
  for (const RankedCandidate& ranked : candidates) {
    const v1::Candidate& candidate = *ranked.candidate;
    if (!(candidate.rmse() > 0) && !candidate.note().empty()) continue;
    const double left = ranked.Left(), whole = largest[ranked.data];
    const double floor = NoiseFloorOf(*ranked.data).sigma;
    const double p = candidate.probability();
    const bool shares = first_step.count(candidate.effect()) > 0;
    absl::StrAppend(
        &table, p < 0.05 || none ? "<tr class=\"dim\">" : "<tr>",
        Cell(absl::StrCat("<span class=\"name\">", Escape(candidate.effect()), "</span>",
                          ScopeWords(candidate), shares ? "<br><small>one of these</small>" : "")),
        NumberCell(EffectProbability(p)), NumberCell(left > 0 ? ErrorScale(*ranked.data).Text(left) : ""),
        Cell(left > 0
                 ? Bar(left / whole, p < 0.05 || none ? "share" : "better", floor > 0 ? floor / whole : -1)
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
                absl::StrCat(
                    "Each effect alone, ", Escape(InPlace(report)), ". It would leave: the RMSE on ",
                    IsJoint(report) ? "readings" : ErrorScale(MainData(report)).readings(),
                    " left out of the fit, dashed the noise floor. Intervals: 95 %, the upright line is "
                    "zero, no effect.",
                    Typeset(shared))) +
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
  // Beside an unexplained verdict without steps the table is what was tried, not an answer.
  const bool none = report.verdict() == v1::Report::UNEXPLAINED && report.steps().empty();
  return Section(
      "why", none ? "What was tried" : "Why",
      absl::StrCat("Every effect of the catalogue", none ? " alone, judged on " : ", fitted and judged on ",
                   ErrorScale(MainData(report)).readings(), " that the fit did not see",
                   none ? ": none explains the error." : "."),
      absl::StrCat(CandidateTable(report), Ambiguities(report)));
}

}  // namespace touchstone::client
