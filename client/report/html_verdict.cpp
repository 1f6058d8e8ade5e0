// The head of the page: the verdict in one sentence, the ladder right below, what limits the report.
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

std::string Pill(const v1::Report& report) {
  const std::string word = VerdictWord(report);
  const char* kind = report.verdict() == v1::Report::ADEQUATE                          ? "pill good"
                     : word.empty() || report.verdict() == v1::Report::TOO_LITTLE_DATA ? "pill plain"
                                                                                       : "pill";
  return absl::StrCat("<span class=\"", kind, "\">", word.empty() ? "Comparison" : word, "</span>");
}

std::string Facts(const v1::Report& report) {
  std::string text = DataInWords(report, "\u00d7");
  text += ".";
  text += NoiseFloorSentence(MainData(report));
  const std::string times = TimesTheFloor(report);
  if (!times.empty()) absl::StrAppend(&text, " The given model's error is ", times, ".");
  if (const std::string nothing = NothingMissingWords(report); !nothing.empty())
    absl::StrAppend(&text, " ", nothing);
  if (!FingerScatterWords(report).empty() && report.verdict() != v1::Report::ADEQUATE)
    absl::StrAppend(&text, " Of the fingers, ", FingerScatterWords(report), ".");
  return Typeset(text);
}

std::string LadderTable(const v1::Report& report) {
  const std::vector<Rung> rungs = Ladder(report);
  if (rungs.empty()) return "";
  const ErrorScale scale(MainData(report));
  static const char* const kClasses[] = {"given", "better", "better", "suggested", "floor"};
  double largest = 0, floor = -1;
  for (const Rung& rung : rungs) {
    largest = std::max(largest, rung.rmse);
    if (rung.kind == Rung::kFloor) floor = rung.rmse;
  }
  std::string table = absl::StrCat(
      "<table class=\"ladder\"><caption class=\"vh\">Error of the model after each change</caption>",
      HeaderRow({"Model", "", ">RMSE", absl::StrCat(">on unseen ", scale.readings()), ">lack-of-fit p"}),
      "<tbody>");
  for (size_t i = 0; i < rungs.size(); ++i) {
    const Rung& rung = rungs[i];
    const bool is_floor = rung.kind == Rung::kFloor;
    absl::StrAppend(
        &table, is_floor ? "<tr class=\"dim last\">" : "<tr>", "<td class=\"name\">", Escape(rung.name),
        "</td>",
        Cell(Bar(rung.rmse / largest, kClasses[rung.kind], is_floor ? -1 : floor / largest), "barcell"),
        NumberCell(scale.Text(rung.rmse)), "<td class=\"num more\" data-label=\"on unseen ", scale.readings(),
        "\">", std::isnan(rung.heldout_rmse) ? "" : Typeset(scale.Text(rung.heldout_rmse)),
        "</td><td class=\"num more\" data-label=\"lack-of-fit p\">",
        std::isnan(rung.lack_of_fit_p) ? "" : Typeset(Probability(rung.lack_of_fit_p)), "</td></tr>\n");
  }
  return Figure(
      absl::StrCat(table, "</tbody></table>"),
      scale.pictures()
          ? "RMSE of the residuals (measured minus expected grey levels, of 255), per pixel. Unseen "
            "pictures: the same on pictures left out of the fit. Lack-of-fit p: how likely that much "
            "misfit beyond noise is if nothing were missing. Dashed: the noise floor."
          : "RMSE of the residuals (measured minus simulated, mean over a touch\u2019s fingers removed), per "
            "finger. "
            "Unseen touches: the same on touches left out of the fit. Lack-of-fit p: how likely that much "
            "misfit "
            "beyond noise is if nothing were missing. Dashed: the noise floor.");
}

}  // namespace

std::string HtmlHead(const v1::Report& report) {
  std::string head = absl::StrCat("<header>\n<p class=\"kicker\">", Pill(report), "<span>Touchstone");
  if (!report.model_name().empty()) {
    absl::StrAppend(&head, " \u00b7 model ", Escape(report.model_name()));
    if (!report.model_hash().empty()) {
      absl::StrAppend(&head, " <code title=\"", Escape(report.model_hash()), "\">",
                      Escape(report.model_hash().substr(0, 12)), "</code>");
    }
  }
  if (!MainData(report).session().empty())
    absl::StrAppend(&head, " \u00b7 ", Escape(MainData(report).session()));
  absl::StrAppend(&head, "</span></p>\n<h1>",
                  absl::StrReplaceAll(Typeset(Headline(report)), {{"built-in", "built\u2011in"}}), "</h1>\n",
                  LadderTable(report));
  const std::string summary = SummaryToShow(report);
  if (!summary.empty()) absl::StrAppend(&head, "<p class=\"lead\">", Typeset(summary), "</p>\n");
  absl::StrAppend(&head, "<p class=\"facts\">", Facts(report), "</p>\n");
  if (!report.warnings().empty()) {
    head += "<aside class=\"warnings\"><p>What limits this report</p><ul>";
    for (const std::string& warning : report.warnings())
      absl::StrAppend(&head, "<li>", Typeset(warning), "</li>");
    head += "</ul></aside>\n";
  }
  return head + "</header>\n";
}

}  // namespace touchstone::client
