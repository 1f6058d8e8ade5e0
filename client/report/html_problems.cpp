// Check the data: the mistakes that explain the error better than physics can, and the commands that fix the file.
#include <algorithm>

#include <absl/strings/str_cat.h>

#include "client/report/error_scale.h"
#include "client/report/html_page.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

constexpr int kCommandColumns = 96;  // that a page has room for

// Errors before and after, as bars of one scale; nothing where the file cannot be fixed.
std::string ErrorBars(const ErrorScale& scale, const v1::DataProblem& problem) {
  const double before = problem.error_before(), after = problem.error_after();
  if (!(before > 0) || !(after > 0)) return "";
  const double largest = std::max(before, after);
  const auto row = [&](const char* name, double error, const char* css_class) {
    return absl::StrCat("<tr><td class=\"name\">", name, "</td>",
                        Cell(Bar(error / largest, css_class), "barcell"), NumberCell(scale.Text(error)),
                        "</tr>");
  };
  return absl::StrCat(
      "<table class=\"ladder\"><caption class=\"vh\">Error of the given model on the file as it is and ",
      "fixed</caption>", HeaderRow({"The file", "", ">RMSE of the given model"}), "<tbody>",
      row("as it is", before, "given"), row("fixed", after, "better"), "</tbody></table>");
}

}  // namespace

std::string HtmlDataProblems(const v1::Report& report) {
  std::string items;
  int number = 0;
  for (const v1::DataProblem& problem : report.data_problems()) {
    const std::string id = absl::StrCat("fix", ++number);
    std::string body = absl::StrCat("<p>", Typeset(problem.words()), "</p>",
                                    ErrorBars(ErrorScale(DataOf(report, problem)), problem));
    if (!problem.fix().empty())
      absl::StrAppend(&body, "<div class=\"row\"><button type=\"button\" data-copy=\"", id,
                      "\">Copy</button><span>fixes the file</span></div>\n<pre id=\"", id, "\">",
                      Escape(ShellLines(problem.fix(), kCommandColumns)), "</pre>\n");
    absl::StrAppend(&items, "<li><span class=\"count\">", number, "</span><div><h3>",
                    Typeset(ProblemTitle(problem)), "</h3>", body, "</div></li>\n");
  }
  if (items.empty()) return "";
  return Section(
      "check", "Check the data",
      "A mistake in the file explains the error far better than physics can. No effect was looked for: "
      "fix the file, and diagnose again.",
      absl::StrCat("<ol class=\"steps\">", items, "</ol>\n"));
}

}  // namespace touchstone::client
